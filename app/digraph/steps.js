// "Step through": the seven steps that make Pgraph with their stack, and the trace of a frame
// update; on the model at hand, one step at a time, marked in the digraph and its vectors.
pgraph.steps = (() => {
  const { make } = pgraph;
  const KINDS = [
    ["pgraph", "Seven steps (fig. 4)"],
    ["frames", "Frame update (fig. 8)"],
  ];
  const PACE = 900; // [ms] between steps while playing
  const boxes = new Set();

  function toggle() {
    walk(pgraph.latest.steps?.kind ? "" : "pgraph");
  }
  function walk(what) {
    pgraph.send("StepThrough", { what });
  }

  function build(box, host) {
    const { button } = pgraph;
    const kinds = KINDS.map(([kind, text]) =>
      make("button", {
        className: "kind",
        textContent: text,
        "data-kind": kind,
        onclick: () => walk(kind),
      }),
    );
    const first = button("first", "", "to the start", () => go(box, 0));
    first.append(pgraph.icon("start"));
    first.setAttribute("aria-label", "to the start");
    Object.assign(box, { host, at: 0, timer: null });
    boxes.add(box);
    box.append(
      make(
        "div",
        { className: "bar" },
        ...kinds,
        make("span", { className: "spring" }),
        button("close", "Close", "Back to the digraph", () => walk("")),
      ),
      make(
        "div",
        { className: "bar" },
        first,
        button("previous", "Back", "one step back", () => go(box, box.at - 1)),
        button("next", "Next", "one step on", () => go(box, box.at + 1)),
        button("run", "Play", "step after step", () => play(box, !box.timer)),
        make("span", { className: "muted where" }),
        make("div", { className: "stack" }),
      ),
      make("div", { className: "said", role: "status" }),
      make("div", { className: "shown" }),
      pgraph.digraph.legend(),
    );
  }

  function draw(box, data) {
    const same = box.data?.kind === data.kind && JSON.stringify(box.data) === JSON.stringify(data);
    box.data = data;
    box.hidden = !data.kind;
    box.host.classList.toggle("walking", Boolean(data.kind));
    for (const el of box.querySelectorAll(".kind"))
      el.classList.toggle("on", el.dataset.kind === data.kind);
    if (!same) {
      play(box, false);
      box.at = 0;
    }
    box.querySelector(".stack").replaceChildren();
    if (data.kind !== "frames") box.querySelector(".shown").replaceChildren();
    else if (!same) table(box, data);
    go(box, box.at);
  }

  function play(box, on) {
    clearInterval(box.timer);
    box.timer = on ? setInterval(() => go(box, box.at + 1), PACE) : null;
    if (on && box.at === box.data.steps.length - 1) go(box, 0);
    box.querySelector(".run").textContent = on ? "Pause" : "Play";
  }

  function go(box, at) {
    const { kind, steps = [] } = box.data ?? {};
    clear(box);
    if (!kind || !steps.length) {
      box.querySelector(".said").textContent = kind ? "No bodies, no steps." : "";
      return;
    }
    box.at = Math.max(0, Math.min(at, steps.length - 1));
    box.querySelector(".where").textContent = `${box.at + 1} / ${steps.length}`;
    box.querySelector(".previous").disabled = box.querySelector(".first").disabled = box.at === 0;
    box.querySelector(".next").disabled = box.at === steps.length - 1;
    if (box.at === steps.length - 1 && box.timer) play(box, false);
    (kind === "pgraph" ? stepShown : updateShown)(box, steps);
  }

  // -- fig. 4 -----------------------------------------------------------------------------------
  function stepShown(box, steps) {
    const graph = box.host.graph,
      stack = [];
    let grown = 0,
      SBn = "–",
      TBn = "–";
    for (const s of steps.slice(0, box.at + 1)) {
      if (s.pull) SBn = stack.pop();
      if (s.push !== null) stack.push((SBn = s.push));
      if (s.adds) grown++;
      if (s.tip) TBn = s.tip;
    }
    const now = steps[box.at];
    box
      .querySelector(".said")
      .replaceChildren(make("strong", { textContent: `Step ${now.step}. ` }), now.text);
    const places = stack.map((k) => make("span", { className: "place", textContent: k }));
    box
      .querySelector(".stack")
      .replaceChildren(
        make("span", { className: "muted", textContent: "SBS" }),
        ...(places.length ? places : [make("span", { className: "muted", textContent: "empty" })]),
        make("span", { className: "muted", textContent: `SBn ${SBn}` }),
        make("span", { className: "muted", textContent: `TBn ${TBn}` }),
      );
    const entries = [...box.host.querySelectorAll(".vectors .entry")];
    entries.forEach((el, i) => el.classList.toggle("pending", i >= grown));
    entries.forEach((el, i) => el.classList.toggle("fresh", i === grown - 1 && Boolean(now.adds)));
    entries[Math.max(grown - 1, 0)]?.scrollIntoView({ block: "nearest" });
    const seen = new Set(graph.data.pgraph.slice(0, grown));
    graph.data.names.forEach((_, i) => {
      if (!seen.has(i + 1) && i + 1 !== now.body) mark(graph, i + 1, "unmet");
    });
    for (const k of stack) mark(graph, k, "stacked");
    current(box, now.body);
  }

  // -- fig. 8 -----------------------------------------------------------------------------------
  function table(box, data) {
    const row = (cells, tag) =>
      make("tr", {}, ...cells.map((text) => make(tag, { textContent: text })));
    const rows = data.steps.map((s, i) => {
      const tr = row([s.kappa, s.number, s.find, s.P.join(" ") || "–", s.does], "td");
      tr.onclick = () => go(box, i);
      return tr;
    });
    box
      .querySelector(".shown")
      .replaceChildren(
        make(
          "div",
          { className: "trace" },
          make(
            "table",
            {},
            make("thead", {}, row(["κ", "Pgraph(κ)", "find", "P", "F(P)"], "th")),
            make("tbody", {}, ...rows),
          ),
        ),
      );
  }
  function updateShown(box, steps) {
    const now = steps[box.at],
      graph = box.host.graph;
    const said = now.P.length
      ? `${now.number} is met for the first time: its joint carries ${now.P.join(", ")}. ${now.does}`
      : `find(${now.number}) = ${now.find} < ${now.kappa}: ${now.does}`;
    box
      .querySelector(".said")
      .replaceChildren(make("strong", { textContent: `κ = ${now.kappa}. ` }), said);
    box
      .querySelector(".stack")
      .replaceChildren(make("span", { className: "muted", textContent: box.data.from }));
    box.querySelectorAll("tbody tr").forEach((tr, i) => tr.classList.toggle("now", i === box.at));
    box.querySelector("tr.now")?.scrollIntoView({ block: "nearest" });
    box.host
      .querySelectorAll(".vectors .entry")
      .forEach((el, i) => el.classList.toggle("fresh", i === box.at));
    for (const k of now.P) mark(graph, k, "carried");
    current(box, now.number);
  }

  function current(box, k) {
    const graph = box.host.graph;
    mark(graph, k, "current");
    pgraph.gutter.node(k)?.scrollIntoView?.({ block: "nearest" });
    graph.nodes[k]?.scrollIntoView({ block: "nearest", inline: "nearest" });
  }
  function clear(box) {
    for (const name of ["pending", "fresh", "unmet", "stacked", "carried", "current"]) {
      for (const el of document.querySelectorAll(
        `.pgraph:is([data-view="table"], [data-view="digraph"]) .${name}`,
      ))
        el.classList.remove(name);
    }
  }
  // A node of the gutter and of the drawn tree.
  function mark(graph, k, name) {
    for (const node of [graph.nodes[k], pgraph.gutter.node(k)]) node?.classList.add(name);
  }
  // The digraph was redrawn: its marks are gone.
  function redrawn(host) {
    for (const box of boxes) if (box.host === host && box.data?.kind) go(box, box.at);
  }

  return { build, draw, toggle, redrawn };
})();

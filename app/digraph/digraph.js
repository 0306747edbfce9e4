// The digraph as a drawn tree, and the Pgraph and jdof vectors below it; every entry selects its body.
pgraph.digraph = (() => {
  const { make, svg } = pgraph;
  const RADIUS = 11,
    CORNER = 6,
    GAP = 6,
    NAME = 8,
    EDGE = 8; // [px], the last ones around a name and within the panel
  const pen = document.createElement("canvas").getContext("2d");
  const SPLIT = 1600; // [px] of the window from which the tree is drawn at first
  const select = (name) => pgraph.send("Select", { body: name });

  // With Ctrl a body joins those that are selected, or leaves them.
  function picked(name, more) {
    pgraph.send(more ? "ToggleBody" : "Select", { body: name });
  }

  function build(host) {
    const canvas = svg("svg", {
      class: "graph digraph",
      role: "group",
      "aria-label": "digraph of the bodies",
    });
    host.pgraphSteps = make("div", { className: "steps", hidden: true });
    host.replaceChildren(
      make("div", { className: "picture" }, make("div", { className: "sheet" }, canvas)),
      host.pgraphSteps,
      make(
        "h4",
        {},
        make("span", {
          title:
            "Pgraph: the order of a walk round the tree. jdof, below it: the degrees of freedom that each entry adds. In italics: back at a body that several branches leave",
          textContent: "Pgraph vector, DoF per joint",
        }),
        make("button", {
          className: "link walk",
          textContent: "How it is built",
          title: "The seven steps that make Pgraph, and a frame update",
          onclick: () => pgraph.steps.toggle(),
        }),
      ),
      make("div", {
        className: "vectors",
        onclick: (event) => {
          const entry = event.target.closest(".entry");
          if (entry) select(entry.dataset.name || null);
        },
      }),
    );
    canvas.addEventListener("click", (event) => {
      const k = numberAt(event.target);
      if (k) picked(host.graph.data.names[k - 1], event.ctrlKey || event.metaKey);
      else if (event.target.closest("g.ground") && pgraph.latest.constraints?.picking)
        pgraph.send("PickName", { name: "ground" });
    });
    canvas.addEventListener("keydown", (event) => keyed(host, event));
    for (const type of ["focusin", "pointerover"])
      canvas.addEventListener(type, (event) => hover(host, numberAt(event.target)));
    for (const type of ["focusout", "pointerleave"])
      canvas.addEventListener(type, () => hover(host, 0));
    pgraph.steps.build(host.pgraphSteps, host);
    const wide = matchMedia(`(min-width: ${SPLIT}px)`);
    wide.onchange = () => toggle(pgraph.choices.get().graph ?? wide.matches, false);
    wide.onchange();
    new ResizeObserver(() => pgraph.draw("digraph", "digraph")).observe(
      host.querySelector(".sheet"),
    );
  }
  // The drawn tree, beside the gutter of the table.
  function toggle(on = document.documentElement.dataset.graph === undefined, chosen = true) {
    if (on) document.documentElement.dataset.graph = "";
    else delete document.documentElement.dataset.graph;
    document.querySelector(".acts .graph")?.setAttribute("aria-pressed", on);
    if (chosen) pgraph.choices.set({ graph: on });
  }

  // What the signs mean.
  function legend() {
    const sign = (text, ...shapes) =>
      make(
        "span",
        {},
        svg("svg", { class: "graph sign", viewBox: "-10 -10 20 20" }, ...shapes),
        text,
      );
    const circle = (r, kind = "") =>
      svg(
        "g",
        { class: `node ${kind}` },
        svg("circle", { r, class: kind === "outer" ? "outer" : "" }),
      );
    return make(
      "div",
      { className: "legend muted" },
      sign(
        "separation body",
        circle(5),
        svg("g", { class: "node" }, svg("circle", { r: 8, class: "outer" })),
      ),
      sign("tip", circle(7, "tip")),
      sign(
        "to the ground",
        svg("g", { class: "loop" }, svg("path", { class: "mark", d: hatch(0, -3) })),
      ),
      sign("loop", svg("g", { class: "loop" }, svg("path", { d: "M-10 0 h20" }))),
      make("span", {
        textContent: "Drag a number onto its new parent, with Shift to close a loop.",
        className: "how",
      }),
    );
  }

  // The tree in the width of its panel: columns move together until their nodes nearly touch, letters keep their size.
  function squeezed(host, data) {
    const room = host.querySelector(".sheet").clientWidth - 2 * EDGE,
      { x, y, width } = data;
    if (data.kind !== "tree" || room <= 0) return data;
    const next = x.map((at, k) => Math.min(...x.filter((other, j) => y[j] === y[k] && other > at)));
    const by = Math.min(
      1,
      Math.max(
        room / width,
        (2 * RADIUS + GAP) / Math.min(...next.map((other, k) => other - x[k])),
      ),
    );
    const rooms = x.map(
      (at, k) =>
        by * (Math.min(next[k], width) - at) - (next[k] < width ? 2 : 1) * RADIUS - NAME - GAP,
    );
    const moved = (at) => EDGE + at * by;
    return {
      ...data,
      rooms,
      x: x.map(moved),
      width: width * by + 2 * EDGE,
      routes: data.routes.map((points) => points.map(([at, high]) => [moved(at), high])),
    };
  }
  // A name in one line, or in two of about the same length, or as much of it as there is room for.
  function label(name, room) {
    pen.font = `600 11px ${getComputedStyle(document.querySelector(".pgraph")).fontFamily}`;
    const fits = (text) => pen.measureText(text).width <= room;
    if (fits(name)) return name;
    const uneven = (two) => Math.abs(two[0].length - two[1].length);
    const halves = [...name.matchAll(/[_ ]/g)]
      .map(({ index }) => [name.slice(0, index + 1), name.slice(index + 1)])
      .sort((a, b) => uneven(a) - uneven(b));
    const two = halves.find((each) => each.every(fits));
    if (two) return two.join("\n");
    let n = name.length - 1;
    while (n && !fits(`${name.slice(0, n)}…`)) n--;
    return n ? `${name.slice(0, n)}…` : "";
  }

  function draw(host, payload) {
    const canvas = host.querySelector("svg.digraph"),
      data = squeezed(host, payload);
    const before = host.graph,
      known = before?.data;
    const focused = canvas.contains(document.activeElement)
      ? known?.names[numberAt(document.activeElement) - 1]
      : undefined;
    const tips = new Set(data.tips),
      separation = new Set(data.separation);
    const children = [[], ...data.names.map(() => [])];
    data.parent.forEach((p, i) => children[p].push(i + 1));
    const kind = (k) => (tips.has(k) ? " tip" : separation.has(k) ? " separation" : "");
    const { parts, part } = keeping(before?.parts);
    const tree = data.kind === "tree"; // of more bodies the gutter of the table is the digraph
    host.classList.toggle("large", !tree);
    const graph = (host.graph = {
      data,
      children,
      parts,
      reachable: 1,
      nodes: tree ? [ground(data, part)] : [],
      edges: [null],
      entries: data.names.map(() => []),
      marked: [],
    });
    graph.entries.unshift([]);
    for (let k = 1; tree && k <= data.names.length; k++) {
      graph.nodes.push(node(data, k, kind(k), part));
      graph.edges.push(edge(data, k, part));
    }
    vectors(host.querySelector(".vectors"), graph, part);
    arrange(canvas, [...graph.edges.slice(1), ...(tree ? loops(data, part) : []), ...graph.nodes]);
    Object.assign(canvas.style, { width: `${data.width}px`, height: `${data.height}px` });
    mark(host, pgraph.latest.selection);
    const again = focused === undefined ? 0 : data.names.indexOf(focused) + 1;
    if (graph.nodes[again] && again) {
      reachable(graph, again);
      graph.nodes[again].focus({ preventScroll: true });
    }
    hover(host, known ? data.names.indexOf(known.names[(before.hovered ?? 0) - 1]) + 1 : 0);
    pgraph.steps.redrawn(host);
  }

  // Elements by what they are made from: a redraw makes only those again that have changed,
  // and the rest is as if it were new.
  function keeping(before) {
    const parts = new Map();
    const part = (key, made) => {
      const known = key.join("\u0000"),
        el = before?.get(known) ?? made();
      el.pgraphClass ??= el.getAttribute("class");
      if (el.getAttribute("class") !== el.pgraphClass) el.setAttribute("class", el.pgraphClass);
      parts.set(known, el);
      return el;
    };
    return { parts, part };
  }
  // These elements and no others, in this order; what stands where it should is not touched.
  function arrange(box, elements) {
    const wanted = new Set(elements);
    for (const el of [...box.children]) if (!wanted.has(el)) el.remove();
    let at = box.firstElementChild;
    for (const el of elements) {
      if (at === el) at = at.nextElementSibling;
      else box.insertBefore(el, at);
    }
  }

  function vectors(box, graph, part) {
    const { data } = graph,
      met = new Set([0]);
    const entry = (k, i) => {
      const name = k > 0 ? data.names[k - 1] : "ground";
      const again = met.has(k);
      met.add(k);
      const made = part(["entry", i, k, name, again, data.jdof[i]], () =>
        make(
          "span",
          {
            className: again ? "entry again" : "entry",
            title: again
              ? `Back to ${name} for its next branch: adds nothing, jdof ${data.jdof[i]}`
              : `${name}, jdof ${data.jdof[i]}`,
            "data-name": k > 0 ? name : "",
          },
          make("span", { textContent: k }),
          make("span", { textContent: data.jdof[i] }),
        ),
      );
      graph.entries[k].push(made);
      return made;
    };
    arrange(box, data.pgraph.map(entry));
  }

  function edge(data, k, part) {
    const p = data.parent[k - 1],
      x0 = data.x[p],
      y0 = data.y[p],
      x1 = data.x[k],
      y1 = data.y[k];
    const end = y1 - RADIUS - 1.5,
      d = `M${x0} ${y0} C${x0} ${y0 + 24} ${x1} ${y1 - 26} ${x1} ${end} m-3 -4.5 l3 4.5 l3 -4.5`,
      dof = data.dof[k - 1];
    return part(["edge", k, data.names[k - 1], d, dof, data.colors[k - 1]], () => {
      const g = svg(
        "g",
        { class: "edge", "data-edge": data.names[k - 1], style: `--body: ${data.colors[k - 1]}` },
        svg("path", { d }),
      );
      if (dof !== 1) g.append(written("dof", x1 + (x0 > x1 ? -12 : 7), y1 - RADIUS - 4, dof)); // one is ordinary
      return g;
    });
  }

  // A constraint: to the ground as a mark below the node, to another body as a dashed line.
  function loops(data, part) {
    return data.loops.map(({ name, kind, body, other }, i) => {
      const x = data.x[body || other],
        y = data.y[body || other];
      const grounded = body === 0 || other === 0;
      const d = grounded ? hatch(x, y + RADIUS + 4) : rounded(data.routes[i]);
      return part(["loop", i, name, kind, grounded, d], () => {
        const lines = grounded
          ? [svg("path", { class: "mark", d })]
          : [svg("path", { class: "reach", d }), svg("path", { class: "line", d })];
        return svg(
          "g",
          { class: "loop", "data-loop": name },
          svg("title", {}, `${name} (${kind})`),
          ...lines,
        );
      });
    });
  }
  const hatch = (x, y) => `M${x - 8} ${y} h16 M${x - 5} ${y + 3} h10 M${x - 2} ${y + 6} h4`;
  const written = (className, x, y, text) => svg("text", { class: className, x, y }, String(text));

  // A line through points, its corners rounded.
  function rounded(points) {
    let d = `M${points[0].join(" ")}`;
    for (let i = 1; i < points.length - 1; i++) {
      const [a, b, c] = [points[i - 1], points[i], points[i + 1]];
      d += ` L${near(b, a)} Q${b.join(" ")} ${near(b, c)}`;
    }
    return `${d} L${points.at(-1).join(" ")}`;
  }
  function near(corner, end) {
    const dx = end[0] - corner[0],
      dy = end[1] - corner[1],
      far = Math.hypot(dx, dy) || 1,
      part = Math.min(CORNER, far / 2) / far;
    return `${corner[0] + part * dx} ${corner[1] + part * dy}`;
  }

  function ground(data, part) {
    const x = data.x[0],
      y = data.y[0];
    return part(["ground", x, y], () =>
      svg(
        "g",
        { class: "ground", "data-number": 0, "aria-label": "ground" },
        svg("rect", { x: x - 12, y: y - 12, width: 70, height: 22 }),
        svg("path", { d: hatch(x, y) }),
        written("label muted", x + 14, y + 4, "ground"),
      ),
    );
  }

  function node(data, k, kind, part) {
    const name = data.names[k - 1],
      place = [data.x[k], data.y[k], label(name, data.rooms?.[k] ?? Infinity)];
    const g = part(["node", k, kind, name, data.colors[k - 1], ...place], () =>
      drawn(data, k, kind, ...place),
    );
    if (g.getAttribute("tabindex") !== String(k === 1 ? 0 : -1))
      g.setAttribute("tabindex", k === 1 ? 0 : -1);
    return g;
  }
  function drawn(data, k, kind, x, y, said) {
    const name = data.names[k - 1],
      g = svg("g", {
        class: `node${kind}`,
        "data-name": name,
        "data-number": k,
        tabindex: k === 1 ? 0 : -1,
        role: "button",
        "aria-label": `${k} ${name}`,
        style: `--body: ${data.colors[k - 1]}`,
      });
    if (kind === " separation")
      g.append(svg("circle", { class: "outer", cx: x, cy: y, r: RADIUS + 3 }));
    g.append(
      svg("title"),
      svg("circle", { cx: x, cy: y, r: RADIUS }),
      written("number", x, y + 3.5, k),
      ...said
        .split("\n")
        .map((line, i, all) =>
          written("label", x + RADIUS + NAME, y + (all.length > 1 ? 12 * i - 2 : 4), line),
        ),
    );
    return g;
  }
  const numberAt = (el) => Number(el.closest?.("g.node")?.dataset.number ?? 0);

  // -- what is marked: the selection, and under the pointer the path to the root ---------------
  const parts = (graph, j) => [graph.nodes[j], graph.edges[j], ...graph.entries[j]].filter(Boolean);
  function mark(host, selection) {
    const graph = host.graph;
    if (!graph) return;
    for (const el of graph.marked) el.classList.remove("selected");
    const number = (name) => graph.data.names.indexOf(name) + 1;
    const k = number(selection),
      first = number(pgraph.latest.constraints?.picking?.first);
    const all = new Set([k, first, ...(pgraph.latest.selected ?? []).map(number)].filter(Boolean));
    graph.marked = [...all].flatMap((j) => parts(graph, j));
    for (const el of graph.marked) el.classList.add("selected");
    along(graph, k);
    reachable(graph, k || 1);
    if (!k) return;
    pgraph.beforePicture("digraph place", () => {
      graph.entries[k][0]?.scrollIntoView({ block: "nearest" });
      reveal(graph.nodes[k]);
    });
  }
  const reveal = (node) => node?.scrollIntoView({ block: "nearest", inline: "nearest" });
  // One node takes part in the order of tabs; arrows lead to the others.
  function reachable(graph, k) {
    if (k === graph.reachable) return;
    graph.nodes[graph.reachable]?.setAttribute("tabindex", -1);
    graph.nodes[(graph.reachable = k)]?.setAttribute("tabindex", 0);
  }

  function path(data, k) {
    const found = [];
    for (; k > 0; k = data.parent[k - 1]) found.push(k);
    return found;
  }

  const about = ({ names, parent, joints, dof, masses, sites }, k) =>
    [
      names[k - 1],
      `${joints[k - 1]} joint to ${names[parent[k - 1] - 1] ?? "ground"}`,
      `${dof[k - 1]} DoF`,
      `${Number(masses[k - 1].toPrecision(4))} kg`,
      ...sites[k - 1],
    ].join(", ");
  function along(graph, k) {
    for (const el of graph.path ?? []) el.classList.remove("path");
    graph.path = path(graph.data, k).flatMap((j) => parts(graph, j));
    for (const el of graph.path) el.classList.add("path");
  }
  function hover(host, k) {
    const { graph } = host;
    if (!graph || graph.hovered === k) return;
    graph.hovered = k;
    if (k) graph.nodes[k].querySelector("title").textContent = about(graph.data, k);
    along(graph, k || graph.data.names.indexOf(pgraph.latest.selection) + 1);
  }
  // -- keys: along the tree, to the neighbour at the same depth, Enter selects -----------------
  function keyed(host, event) {
    const { data, children, nodes } = host.graph,
      k = numberAt(event.target);
    if (!k) return;
    const neighbour = (step) => {
      const depth = path(data, k).length,
        row = data.names.map((_, i) => i + 1).filter((j) => path(data, j).length === depth);
      return row[row.indexOf(k) + step];
    };
    const next = {
      ArrowUp: () => data.parent[k - 1],
      ArrowDown: () => children[k][0],
      ArrowLeft: () => neighbour(-1),
      ArrowRight: () => neighbour(1),
      Home: () => 1,
    }[event.key];
    if (event.key === "Enter") select(data.names[k - 1]);
    else if (!next) return;
    event.preventDefault();
    const to = next?.();
    if (!to) return;
    reachable(host.graph, to);
    reveal(nodes[to]);
    nodes[to].focus({ preventScroll: true });
  }

  pgraph.view("digraph", {
    build,
    digraph: draw,
    selection: mark,
    selected: (host) => mark(host, pgraph.latest.selection),
    constraints: (host) => mark(host, pgraph.latest.selection),
    steps: (host, data) => pgraph.steps.draw(host.pgraphSteps, data),
  });
  return { toggle, legend };
})();

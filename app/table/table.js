// The table of bodies: the digraph as its gutter, name, parent, joint and constraints. Its keys
// and the clipboard are in keys.js, what is done to whole rows in rows.js.
pgraph.table = (() => {
  const { make, cells } = pgraph;
  const DOF = ["weld", "revolute", "universal", "spherical", "ball + z", "ball + x + y", "free"];
  const HEAD = [
    [
      "Graph",
      "numbers of the Pgraph, a lane for each branch; drag a number to move its row, onto another row to attach it there, with Shift to close a loop with it",
    ],
    ["Body", "its name"],
    ["Parent", "the body it is attached to, or ground"],
    ["DoF", "degrees of freedom of its joint, beside the kind of the joint"],
    [
      "Constraint",
      "kinds of what constrains it: holonomic is its joint alone, others are in the list of connections",
    ],
  ];
  const LAZY = 60; // rows from which cells are made when they come near the view
  let rows = [],
    byName = new Map(),
    trs = new Map(),
    anchor = null,
    near = null;

  const selected = () => pgraph.latest.selected ?? [];
  const shown = () => rows.map((row) => row.name);

  function build(host) {
    const head = make(
      "tr",
      {},
      ...HEAD.map(([text, title]) => make("th", { textContent: text, title })),
    );
    const body = make("tbody");
    body.addEventListener("mousedown", pressed);
    body.addEventListener("click", (event) => {
      // on a number of several selected rows, and no drag
      const plain = !event.shiftKey && !event.ctrlKey && !event.metaKey;
      if (plain && event.target.closest(".number")) pick(nameOf(event.target));
    });
    for (const type of ["focusin", "input"])
      body.addEventListener(type, (event) => focused(event.target));
    const rowOf = (event) => event.target.closest?.("tr[data-name]");
    for (const type of ["pointerover", "focusin"])
      body.addEventListener(type, (event) => {
        const tr = rowOf(event);
        if (tr) arm(tr);
      });
    for (const type of ["pointerout", "focusout"])
      body.addEventListener(type, (event) => {
        const tr = rowOf(event);
        if (tr) setTimeout(rest, 0, tr);
      });
    host.replaceChildren(
      make("table", { className: "bodies" }, make("thead", {}, head), body),
      make("p", { className: "muted empty", hidden: true }),
    );
    body.addEventListener(
      "wheel",
      (event) => {
        // sideways, or with Shift
        const by = event.deltaX || (event.shiftKey ? event.deltaY : 0);
        if (by && event.target.closest(".number") && pgraph.gutter.move(host, by))
          event.preventDefault();
      },
      { passive: false },
    );
    near?.disconnect();
    near = new IntersectionObserver(
      (seen) => {
        for (const { target, isIntersecting } of seen) if (isIntersecting) furnish(target);
      },
      { rootMargin: "600px" },
    );
    pgraph.keys.listen(host);
    pgraph.drag.listen(body);
    pgraph.rows.build();
    trs = new Map();
  }

  // -- selection: a click takes one row, Ctrl adds or takes away, Shift takes all between --------
  const nameOf = (target) => target.closest?.("tr[data-name]")?.dataset.name;

  function pressed(event) {
    const name = nameOf(event.target);
    if (name === undefined || event.button !== 0) return;
    if (event.shiftKey || event.ctrlKey || event.metaKey) {
      event.preventDefault();
      trs.get(name).focus({ preventScroll: true });
      if (event.shiftKey) extend(name);
      else toggle(name);
      return;
    }
    if (event.target.closest(".number") && selected().includes(name)) return; // perhaps a drag
    pick(name);
  }
  function focused(target) {
    const name = nameOf(target);
    if (
      name !== undefined &&
      cells.resting() &&
      target.matches(".cell, button.tied") &&
      !selected().includes(name)
    )
      pick(name);
  }
  function pick(name) {
    anchor = name;
    // also if it is selected already: it closes the form of a connection
    pgraph.latest.selected = [name]; // keys may repeat before the answer is here
    pgraph.latest.selection = name;
    pgraph.send("Select", { body: name });
  }
  function toggle(name) {
    const rest = selected().filter((other) => other !== name);
    anchor = name;
    pgraph.latest.selected = rest.length === selected().length ? [...rest, name] : rest;
    pgraph.latest.selection = pgraph.latest.selected.at(-1) ?? null;
    pgraph.send("ToggleBody", { body: name });
  }
  function extend(to) {
    const names = shown(),
      from = names.indexOf(anchor ?? pgraph.latest.selection),
      at = names.indexOf(to);
    if (from < 0 || at < 0) {
      pick(to);
      return;
    }
    choose(names.slice(Math.min(from, at), Math.max(from, at) + 1), to);
  }
  function choose(bodies, body) {
    pgraph.latest.selected = bodies;
    pgraph.latest.selection = body;
    pgraph.send("SelectBodies", { body, bodies });
  }

  // -- drawing ---------------------------------------------------------------------------------
  function draw(host, data) {
    rows = data.rows;
    byName = new Map(rows.map((row) => [row.name, row]));
    const { gutter } = pgraph;
    gutter.set(data);
    trs = pgraph.keyed(host.querySelector("tbody"), rows, newRow, fill, (tr) => near.unobserve(tr));
    pgraph.frame.count("Bodies", rows.length);
    host.querySelector("table").style.setProperty("--gutter", `${gutter.width}px`);
    host.querySelector(".empty").hidden = rows.length > 0;
    mark(host);
    others(host, pgraph.latest.others);
  }

  function newRow() {
    const tr = make("tr", { tabIndex: -1 });
    tr.append(
      make(
        "td",
        { className: "number", draggable: true },
        make("span", { className: "lanes" }),
        make("span", { className: "others" }),
      ),
      make("td"),
      make("td"),
      make("td", { className: "freedoms" }),
      make("td", { className: "constraint" }),
    );
    if (rows.length > LAZY) near.observe(tr);
    else furnish(tr);
    return tr;
  }

  const edit = (tr, field) => (serial, text) =>
    pgraph.send("EditBodies", { serial, bodies: [tr.dataset.name], field, entries: [[[], text]] });

  // The digraph and the joint's picture; until then the row shows text.
  function furnish(tr) {
    near.unobserve(tr);
    if (tr.dataset.furnished) return;
    tr.dataset.furnished = "1";
    tr.children[3].replaceChildren(
      make("span", { className: "kind" }),
      make("span", { className: "dof" }),
    );
    const row = byName.get(tr.dataset.name);
    tr.dataset.drawn = "";
    if (row) fill(tr, row);
  }
  // Its cells, where the pointer or the focus is, or the selection.
  function arm(tr) {
    furnish(tr);
    if (tr.dataset.armed) return;
    tr.dataset.armed = "1";
    tr.children[1].replaceChildren(
      cells.input(edit(tr, "name"), { label: "name", className: "name" }),
    );
    tr.children[2].replaceChildren(
      cells.choice(() => parents(tr.dataset.name), edit(tr, "parent"), { label: "parent" }),
    );
    if (byName.get(tr.dataset.name)?.joint !== "beam")
      tr.children[3].append(
        cells.choice(() => dofs(tr.dataset.name), edit(tr, "dof"), { label: "DoF" }),
      );
    tr.children[4].replaceChildren(
      make("button", {
        className: "tied",
        onclick: () => pgraph.show("Connections", tr.dataset.name),
      }),
    );
    refill(tr);
  }
  function rest(tr) {
    if (
      !tr.dataset.armed ||
      tr.matches(".selected, :hover") ||
      tr.contains(document.activeElement) ||
      [...tr.querySelectorAll(".cell")].some(
        (cell) => cell.value !== cell.dataset.shown || cell.matches(".refused, .waiting"),
      )
    )
      return;
    delete tr.dataset.armed;
    tr.querySelector(".freedoms .cell")?.remove();
    tr.children[4].textContent = "";
    refill(tr);
  }
  function refill(tr) {
    const row = byName.get(tr.dataset.name);
    if (row && tr.dataset.drawn) fillCells(tr, row); // what is under the pointer stays
  }

  function fill(tr, row) {
    const text = JSON.stringify(row) + pgraph.gutter.width;
    if (tr.dataset.drawn === text) return;
    tr.dataset.drawn = text;
    [row.name, row.parent].forEach((value, i) => {
      tr.children[i + 1].title = value;
    });
    if (!tr.dataset.furnished) {
      [row.name, row.parent, row.dof, brief(row)].forEach((value, i) => {
        tr.children[i + 1].textContent = value;
      });
      return;
    }
    pgraph.gutter.draw(tr.querySelector(".lanes"), row);
    fillCells(tr, row);
  }
  const brief = ({ constraint }) => {
    const [first, ...others] = constraint.split(", ");
    return others.length ? `${first} +${others.length}` : first;
  };
  function fillCells(tr, row) {
    const [name, parent, dof] = tr.querySelectorAll(".cell"),
      tied = tr.children[4];
    tr.children[3].title = `${row.joint}, ${row.dof} DoF`;
    tr.querySelector(".kind").replaceChildren(pgraph.gutter.joint(row.joint));
    tr.querySelector(".dof").textContent = row.dof;
    tied.title = row.constraints.length
      ? `${row.constraint}: ${row.constraints.join(", ")}; click to see them`
      : `its ${row.joint} joint alone; click to add a constraint`;
    tied.classList.toggle("on", row.tied);
    const button = tied.querySelector("button");
    (button ?? tied).textContent = brief(row);
    button?.setAttribute("aria-label", row.constraint);
    if (!tr.dataset.armed) {
      [row.name, row.parent].forEach((value, i) => {
        tr.children[i + 1].textContent = value;
      });
      return;
    }
    cells.set(name, row.name);
    cells.choose(parent, row.parent);
    if (!dof) return;
    cells.choose(dof, String(row.dof));
    if (dof.selectedOptions[0]) dof.selectedOptions[0].textContent = `${row.dof} ${row.joint}`;
    dof.title = tr.children[3].title;
  }

  // Whether a typed name can only be refused: it is empty, or another row's.
  function taken(tr, text) {
    const typed = text.trim(),
      called = (row) => {
        const cell = trs.get(row.name)?.querySelector("input.name.waiting");
        return (cell?.dataset.sent ?? row.name).trim();
      };
    return !typed || rows.some((row) => row.name !== tr.dataset.name && called(row) === typed);
  }

  // Ground and every body that does not hang on `name` itself.
  function parents(name) {
    const below = new Set([name]);
    for (const row of [...rows].sort((a, b) => a.number - b.number)) {
      if (below.has(row.parent)) below.add(row.name);
    }
    const free = rows.filter((row) => !below.has(row.name)).map((row) => [row.name, row.name]);
    return [["ground", "ground"], ...free];
  }
  function dofs(name) {
    const row = byName.get(name);
    return DOF.map((joint, d) => [String(d), `${d} ${row?.dof === d ? row.joint : joint}`]);
  }

  function mark(host) {
    const last = pgraph.latest.selection ?? null,
      all = new Set(selected());
    for (const tr of host.querySelectorAll("tr.selected")) {
      tr.classList.remove("selected", "last");
      if (!all.has(tr.dataset.name)) rest(tr);
    }
    for (const name of all) trs.get(name)?.classList.add("selected");
    if (trs.has(last)) {
      arm(trs.get(last));
      pgraph.gutter.reveal(host, byName.get(last));
    }
    const tr = last === null ? null : trs.get(last);
    tr?.classList.add("selected", "last");
    pgraph.beforePicture("table", () => {
      if (tr?.isConnected && !tr.contains(document.activeElement))
        tr.scrollIntoView({ block: "nearest" });
    });
    pgraph.gutter.path(host, last === null ? [] : way(last));
  }

  // The numbers from a body to the ground.
  function way(name) {
    const found = [];
    for (let row = byName.get(name); row; row = byName.get(row.parent)) found.push(row.number);
    return found;
  }

  // Small dots where other people are.
  function others(host, data) {
    for (const dots of host.querySelectorAll(".others:not(:empty)")) dots.replaceChildren();
    for (const [name, colors] of Object.entries(data ?? {})) {
      const dots = trs.get(name)?.querySelector(".others");
      dots?.replaceChildren(
        ...colors.map((color) => {
          const dot = make("i", { title: "selected on another page" });
          dot.style.background = color;
          return dot;
        }),
      );
    }
  }

  pgraph.view("table", { build, table: draw, selection: mark, selected: mark, others });
  return {
    selected,
    shown,
    extend,
    pick,
    taken,
    arm,
    row: (name) => byName.get(name),
    tr: (name) => trs.get(name),
    rows: () => rows,
  };
})();

// The table of bodies: the digraph as its gutter, name, parent, and joint with its constraints. Its keys
// and the clipboard are in keys.js, what is done to whole rows in rows.js.
pgraph.table = (() => {
  const { make, cells } = pgraph;
  const DOF = ["weld", "revolute", "universal", "spherical", "ball + z", "ball + x + y", "free"];
  const HEAD = [
    ["Graph", "numbers of the Pgraph, a lane for each branch; drag a number to move its row, or onto another row to attach it there"],
    ["Body", "its name"],
    ["Parent", "the body it is attached to, or ground"],
    ["DoF", "degrees of freedom of its joint, beside the kind of the joint; a mark where constraints or contacts touch the body"],
  ];
  const LAZY = 60; // rows from which cells are made when they come near the view
  let rows = [], byName = new Map(), trs = new Map(), anchor = null, near = null;

  const selected = () => pgraph.latest.selected ?? [];
  const shown = () => rows.map((row) => row.name);

  function build(host) {
    const head = make("tr", {}, ...HEAD.map(([text, title]) => make("th", { textContent: text, title })));
    const body = make("tbody");
    body.addEventListener("mousedown", pressed);
    body.addEventListener("click", (event) => { // on a number of several selected rows, and no drag
      const plain = !event.shiftKey && !event.ctrlKey && !event.metaKey;
      if (plain && event.target.closest(".number")) pick(nameOf(event.target));
    });
    for (const type of ["focusin", "input"]) body.addEventListener(type, (event) => focused(event.target));
    host.replaceChildren(
      make("table", { className: "bodies" }, make("thead", {}, head), body),
      make("p", { className: "muted empty", hidden: true }),
    );
    near?.disconnect();
    near = new IntersectionObserver((seen) => {
      for (const { target, isIntersecting } of seen) if (isIntersecting) furnish(target);
    }, { rootMargin: "600px" });
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
    if (name !== undefined && cells.resting() && target.matches(".cell, button.tied") && !selected().includes(name)) pick(name);
  }
  function pick(name) {
    anchor = name;
    if (selected().length === 1 && selected()[0] === name) return;
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
    const names = shown(), from = names.indexOf(anchor ?? pgraph.latest.selection), at = names.indexOf(to);
    if (from < 0 || at < 0) { pick(to); return; }
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
      make("td", { className: "number", draggable: true }, make("span", { className: "lanes" }), make("span", { className: "others" })),
      make("td"), make("td"), make("td", { className: "held" }));
    if (rows.length > LAZY) near.observe(tr);
    else furnish(tr);
    return tr;
  }

  // The cells of a row; until then it shows text.
  function furnish(tr) {
    near.unobserve(tr);
    if (tr.dataset.furnished) return;
    tr.dataset.furnished = "1";
    const edit = (field) => (serial, text) =>
      pgraph.send("Edit", { serial, body: tr.dataset.name, field, index: [], text });
    const name = cells.input(edit("name"), { label: "name", className: "name" });
    const parent = cells.choice(() => parents(tr.dataset.name), edit("parent"), { label: "parent" });
    const dof = cells.choice(() => dofs(tr.dataset.name), edit("dof"), { label: "DoF" });
    const constraint = make("button", { className: "tied", onclick: () => pgraph.show("Connections", tr.dataset.name) });
    [[name], [parent], [make("span", { className: "kind" }), make("span", { className: "dof" }), dof, constraint]].forEach((made, i) => tr.children[i + 1].replaceChildren(...made));
    const row = byName.get(tr.dataset.name);
    tr.dataset.drawn = "";
    if (row) fill(tr, row);
  }

  function fill(tr, row) {
    const text = JSON.stringify(row) + pgraph.gutter.width;
    if (tr.dataset.drawn === text) return;
    tr.dataset.drawn = text;
    const constraint = row.constraints.join(", ") || "holonomic";
    [row.name, row.parent].forEach((value, i) => { tr.children[i + 1].title = value; });
    if (!tr.dataset.furnished) {
      [row.name, row.parent, row.dof].forEach((value, i) => { tr.children[i + 1].textContent = value; });
      return;
    }
    pgraph.gutter.draw(tr.querySelector(".lanes"), row);
    const [name, parent, dof] = tr.querySelectorAll(".cell"), button = tr.querySelector("button.tied");
    cells.set(name, row.name);
    cells.choose(parent, row.parent);
    cells.choose(dof, String(row.dof));
    if (dof.selectedOptions[0]) dof.selectedOptions[0].textContent = `${row.dof} ${row.joint}`;
    dof.title = `${row.joint}, ${row.dof} DoF`;
    tr.querySelector(".kind").replaceChildren(pgraph.gutter.joint(row.joint));
    tr.querySelector(".dof").textContent = row.dof;
    button.setAttribute("aria-label", constraint);
    button.title = row.constraints.length ? `${row.held}: ${constraint}; click to see them` : `its ${row.joint} joint alone; click to add a constraint`;
    button.classList.toggle("on", row.constraints.length > 0);
  }

  // Whether a typed name can only be refused: it is empty, or another row's.
  function taken(tr, text) {
    const typed = text.trim(), called = (row) => {
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
    const last = pgraph.latest.selection ?? null, all = new Set(selected());
    for (const tr of host.querySelectorAll("tr.selected")) tr.classList.remove("selected", "last");
    for (const name of all) trs.get(name)?.classList.add("selected");
    const tr = last === null ? null : trs.get(last);
    tr?.classList.add("selected", "last");
    pgraph.beforePicture("table", () => { if (tr?.isConnected && !tr.contains(document.activeElement)) tr.scrollIntoView({ block: "nearest" }); });
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
      dots?.replaceChildren(...colors.map((color) => {
        const dot = make("i", { title: "selected on another page" });
        dot.style.background = color;
        return dot;
      }));
    }
  }

  pgraph.view("table", { build, table: draw, selection: mark, selected: mark, others });
  return { selected, shown, extend, pick, taken, furnish, row: (name) => byName.get(name), tr: (name) => trs.get(name), rows: () => rows };
})();

// The four-column table of bodies: name, parent, DoF, constraint.
(() => {
  const { make, cells } = pgraph;
  const DOF = ["weld", "revolute", "universal", "spherical", "ball + z", "ball + x + y", "free"];
  const HEAD = [
    ["#", "number in the Pgraph: depth-first, upper row first"],
    ["Body", "its name"],
    ["Parent", "the body or ground it hangs on"],
    ["DoF", "degrees of freedom of its joint, 0 to 6"],
    ["Constraint", "holonomic (the joint alone), or the constraints that touch the body"],
  ];
  let rows = [], byName = new Map();

  function build(host) {
    const head = make("tr", {}, ...HEAD.map(([text, title]) => make("th", { textContent: text, title })));
    const body = make("tbody");
    body.addEventListener("mousedown", (event) => pick(event.target));
    body.addEventListener("focusin", (event) => pick(event.target));
    host.replaceChildren(
      make("div", { className: "bar" }, ...buttons(host), make("span", { className: "count muted" })),
      make("table", { className: "bodies" }, make("thead", {}, head), body),
    );
  }

  function buttons(host) {
    const add = make("button", {
      className: "action add", textContent: "+ Add body", title: "Add a body as child of the selected one",
      onclick: () => pgraph.send("AddBody", { parent: pgraph.latest.selection ?? null }),
    });
    const remove = make("button", {
      className: "action delete", textContent: "Delete", title: "Delete the selected body",
      onclick: () => askDelete(host),
    });
    return [add, remove];
  }

  // A body with children: re-attach them, or delete them too?
  function askDelete(host) {
    host.querySelector(".ask")?.remove();
    const name = pgraph.latest.selection, row = byName.get(name);
    if (!row) return;
    const send = (children) => {
      host.querySelector(".ask")?.remove();
      pgraph.send("DeleteBody", { body: name, children });
    };
    const children = rows.filter((r) => r.parent === name).length;
    if (!children) { send("attach"); return; }
    const button = (text, act) => make("button", { className: "action", textContent: text, onclick: act });
    const what = children === 1 ? "its child" : `its ${children} children`;
    host.querySelector(".bar").after(make("div", { className: "ask" },
      make("span", { textContent: `Delete ${name}:` }),
      button(`attach ${what} to ${row.parent}`, () => send("attach")),
      button("delete its whole branch", () => send("delete")),
      button("Keep", () => host.querySelector(".ask").remove())));
  }

  function pick(target) {
    const name = target.closest("tr[data-name]")?.dataset.name;
    if (name !== undefined && name !== pgraph.latest.selection) pgraph.send("Select", { body: name });
  }

  function draw(host, data) {
    rows = data.rows;
    byName = new Map(rows.map((row) => [row.name, row]));
    const body = host.querySelector("tbody");
    const old = [...body.querySelectorAll("tr[data-name]")];
    const kept = new Map(old.map((tr) => [tr.dataset.name, tr]));
    const now = rows.map((row, i) => {
      const renamed = old[i] && !byName.has(old[i].dataset.name) ? old[i] : null;
      const tr = kept.get(row.name) ?? renamed ?? newRow();
      kept.delete(tr.dataset.name);
      fill(tr, row);
      return tr;
    });
    for (const tr of kept.values()) { note(tr)?.remove(); tr.remove(); }
    now.forEach((tr, i) => place(body, tr, now[i - 1]));
    host.querySelector(".count").textContent = data.count;
    mark(host, pgraph.latest.selection);
  }

  const note = (tr) => (tr.nextElementSibling?.classList.contains("sentence") ? tr.nextElementSibling : null);

  function place(body, tr, before) {
    const after = before ? (note(before) ?? before) : null;
    const inPlace = after ? after.nextElementSibling === tr : body.firstElementChild === tr;
    if (inPlace) return;
    const own = note(tr);
    after ? after.after(tr) : body.prepend(tr);
    if (own) tr.after(own);
  }

  function newRow() {
    const tr = make("tr", { tabIndex: -1 });
    const edit = (field) => (serial, text) =>
      pgraph.send("Edit", { serial, body: tr.dataset.name, field, index: [], text });
    const name = cells.input(edit("name"), { label: "name", className: "name" });
    const parent = cells.choice(() => parents(tr.dataset.name), edit("parent"), { label: "parent" });
    const dof = cells.choice(() => dofs(tr.dataset.name), edit("dof"), { label: "DoF" });
    name.addEventListener("entered", () => nextName(tr)?.focus());
    tr.append(
      make("td", { className: "number" }, make("span", { className: "chip" }), make("span")),
      make("td", {}, name), make("td", {}, parent), make("td", {}, dof),
      make("td", { className: "constraint" }));
    return tr;
  }

  function nextName(tr) {
    let next = tr.nextElementSibling;
    while (next && !next.dataset.name) next = next.nextElementSibling;
    return next?.querySelector("input.name");
  }

  function fill(tr, row) {
    tr.dataset.name = row.name;
    const [name, parent, dof] = tr.querySelectorAll(".cell");
    tr.querySelector(".chip").style.background = row.color;
    tr.querySelector(".number span:last-child").textContent = row.number;
    cells.set(name, row.name);
    cells.choose(parent, row.parent);
    cells.choose(dof, String(row.dof));
    if (dof.selectedOptions[0]) dof.selectedOptions[0].textContent = `${row.dof} ${row.joint}`;
    const constraint = tr.lastElementChild;
    constraint.textContent = row.constraints.join(", ") || "holonomic";
    constraint.title = row.constraints.join(", ") || `holonomic: its ${row.joint} joint alone`;
    constraint.classList.toggle("muted", row.constraints.length === 0);
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

  function mark(host, selection) {
    for (const tr of host.querySelectorAll("tr.selected")) tr.classList.remove("selected");
    const tr = selection === null || selection === undefined ? null
      : [...host.querySelectorAll("tr[data-name]")].find((row) => row.dataset.name === selection);
    tr?.classList.add("selected");
    if (tr && !tr.contains(document.activeElement)) tr.scrollIntoView({ block: "nearest" });
    host.querySelector(".delete").disabled = !tr;
  }

  pgraph.view("table", { build, table: draw, selection: mark });
})();

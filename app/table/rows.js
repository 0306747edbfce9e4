// What is done to whole rows: the buttons above the table, their questions, the number of bodies.
pgraph.rows = (() => {
  const { make, button, cells, send } = pgraph;
  const table = () => pgraph.table;
  const some = (names) => (names.length === 1 ? names[0] : `${names.length} bodies`);

  function bar(host) {
    const count = cells.input((serial, text) => counted(host, serial, text), { label: "number of bodies", className: "bodies-count" });
    const search = make("input", {
      type: "search", className: "search", placeholder: "Search", "aria-label": "search bodies", spellcheck: false,
      oninput: () => table().search(host, search.value),
      onkeydown: (event) => {
        if (event.key !== "Escape") return;
        event.stopPropagation();
        search.value = "";
        table().search(host, "");
      },
    });
    return [
      make("div", { className: "bar" },
        button("add", "+ Add", "A new body on the selected one (Ctrl+Enter)", add),
        pgraph.pictureButton("duplicate", "duplicate", "Duplicate", "Duplicate: a copy, with its constraints and forces (Ctrl+D)", () => duplicate(host)),
        pgraph.pictureButton("mirror", "mirror", "Mirror", "Mirror: the branch reflected: a right leg from a left one", () => mirror(host)),
        pgraph.pictureButton("delete", "delete", "Delete", "Delete: the selected bodies (Delete)", () => remove(host)),
        count, make("span", { className: "count muted" }), make("span", { className: "spring" }), search),
    ];
  }

  function count(host, data) {
    const cell = host.querySelector(".bodies-count"), n = data.rows.length;
    cells.set(cell, String(n), "the number of bodies; a change adds or removes rows at the end");
    host.querySelector(".count").textContent = data.count.replace(/^\d+ /, "");
  }

  function enable(host, n) {
    for (const which of ["duplicate", "mirror", "delete"]) host.querySelector(`.action.${which}`).disabled = n === 0;
  }

  // -- one question at a time, below the buttons -------------------------------------------------
  function ask(host, question, ...answers) {
    close(host);
    host.querySelector(".bar").after(make("div", { className: "ask", onkeydown: (event) => { if (event.key === "Escape") close(host); } },
      make("span", { textContent: question }), ...answers, button("keep", "Cancel", "", () => close(host))));
    host.querySelector(".ask button").focus();
  }
  const close = (host) => host.querySelector(".ask")?.remove();
  const answer = (host, text, event, fields, className = "") =>
    button(className, text, "", () => { close(host); send(event, fields); });
  const children = (names) => table().rows().filter((row) => names.includes(row.parent) && !names.includes(row.name));

  function add() { send("AddBody", { parent: pgraph.latest.selection ?? null }); }

  function duplicate(host) {
    const bodies = table().selected();
    if (!bodies.length) return;
    if (!children(bodies).length) { send("Duplicate", { bodies, subtree: true }); return; }
    ask(host, `Duplicate ${some(bodies)}:`,
      answer(host, "with all it carries", "Duplicate", { bodies, subtree: true }, "primary"),
      answer(host, bodies.length === 1 ? "the body alone" : "these bodies alone", "Duplicate", { bodies, subtree: false }));
  }

  function mirror(host) {
    const body = pgraph.latest.selection, row = table().row(body);
    if (!row) return;
    const bodies = pgraph.latest.selected?.length ? [...pgraph.latest.selected] : [body];
    const of = row.parent === "ground" ? "the world" : row.parent;
    const planes = ["x", "y", "z"].map((plane) => answer(host, plane, "MirrorBranch", { body, plane, bodies }, `plane-${plane}`));
    for (const made of planes) made.title = `The plane through the origin of ${of}, normal to its ${made.textContent} axis`;
    ask(host, `Mirror ${some(bodies)} along`, ...planes);
  }

  // Bodies with children: re-attach them, or delete them too?
  function remove(host) {
    const bodies = table().selected();
    if (!bodies.length) return;
    const left = children(bodies);
    if (!left.length) { close(host); send("DeleteBodies", { bodies, children: "attach" }); return; }
    const what = left.length === 1 ? "its child" : bodies.length === 1 ? `its ${left.length} children` : `${left.length} children`;
    const to = bodies.length === 1 ? table().row(bodies[0]).parent : "the remaining bodies";
    ask(host, `Delete ${some(bodies)}:`,
      answer(host, `attach ${what} to ${to}`, "DeleteBodies", { bodies, children: "attach" }),
      answer(host, bodies.length === 1 ? "delete its whole branch" : "delete their whole branches", "DeleteBodies", { bodies, children: "delete" }));
  }

  // Another number of bodies: more at once, fewer only after a question.
  function counted(host, serial, text) {
    const now = table().rows().length, n = Number(text);
    if (!(/^\d+$/.test(text.trim()) && n >= 1 && n < now)) { send("CountBodies", { serial, text }); return; }
    cells.reply({ serial, text: "" });
    const gone = table().rows().slice(n).map((row) => row.name);
    const list = gone.length > 6 ? `${gone.slice(0, 5).join(", ")}, … ${gone.at(-1)}` : gone.join(", ");
    ask(host, `Delete the last ${gone.length === 1 ? "body" : `${gone.length} bodies`} (${list})?`,
      answer(host, "Delete", "DeleteBodies", { bodies: gone, children: "attach" }, "primary"));
  }

  return { bar, count, enable, add, duplicate, mirror, remove, close };
})();

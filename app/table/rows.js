// What is done to whole rows, and the questions about it.
pgraph.rows = (() => {
  const { make, button, cells, send } = pgraph;
  const table = () => pgraph.table;
  const some = (names) => (names.length === 1 ? names[0] : `${names.length} bodies`);

  // Commands of the tab: the drawn graph, and a new body.
  function build() {
    const graph = make(
      "button",
      {
        className: "bare graph",
        title: "Drawn graph",
        "aria-label": "Drawn graph",
        onclick: () => pgraph.digraph.toggle(),
      },
      pgraph.icon("graph"),
    );
    const more = make(
      "button",
      {
        className: "bare add",
        title: "A new body on the selected one (Ctrl+Enter)",
        "aria-label": "Add a body",
        onclick: add,
      },
      pgraph.icon("add"),
    );
    const beam = make(
      "button",
      {
        className: "bare add-beam",
        title: "A new flexible beam on the selected body",
        "aria-label": "Add a beam",
        onclick: () => send("AddBeam", { parent: pgraph.latest.selection ?? null }),
      },
      pgraph.icon("beam"),
    );
    pgraph.frame.actions("Bodies", graph, beam, more);
  }

  // -- one question at a time, above the rows -------------------------------------------------
  function ask(host, question, ...answers) {
    close(host);
    host.prepend(
      make(
        "div",
        {
          className: "ask",
          onkeydown: (event) => {
            if (event.key === "Escape") close(host);
          },
        },
        make("span", { textContent: question }),
        ...answers,
        button("keep", "Cancel", "", () => close(host)),
      ),
    );
    host.querySelector(".ask button").focus();
  }
  const close = (host) => host.querySelector(".ask")?.remove();
  const answer = (host, text, event, fields, className = "") =>
    button(className, text, "", () => {
      close(host);
      send(event, fields);
    });
  const children = (names) =>
    table()
      .rows()
      .filter((row) => names.includes(row.parent) && !names.includes(row.name));

  function add() {
    send("AddBody", { parent: pgraph.latest.selection ?? null });
  }

  function duplicate(host) {
    const bodies = table().selected();
    if (!bodies.length) return;
    if (!children(bodies).length) {
      send("Duplicate", { bodies, subtree: true });
      return;
    }
    ask(
      host,
      `Duplicate ${some(bodies)}:`,
      answer(host, "with all it carries", "Duplicate", { bodies, subtree: true }, "primary"),
      answer(host, bodies.length === 1 ? "the body alone" : "these bodies alone", "Duplicate", {
        bodies,
        subtree: false,
      }),
    );
  }

  function mirror(host) {
    const body = pgraph.latest.selection,
      row = table().row(body);
    if (!row) return;
    const bodies = pgraph.latest.selected?.length ? [...pgraph.latest.selected] : [body];
    const of = row.parent === "ground" ? "the world" : row.parent;
    const planes = ["x", "y", "z"].map((plane) =>
      answer(host, plane, "MirrorBranch", { body, plane, bodies }, `plane-${plane}`),
    );
    for (const made of planes)
      made.title = `The plane through the origin of ${of}, normal to its ${made.textContent} axis`;
    ask(host, `Mirror ${some(bodies)} along`, ...planes);
  }

  // Bodies with children: re-attach them, or delete them too?
  function remove(host) {
    const bodies = table().selected();
    if (!bodies.length) return;
    const left = children(bodies);
    if (!left.length) {
      close(host);
      send("DeleteBodies", { bodies, children: "attach" });
      return;
    }
    const what =
      left.length === 1
        ? "its child"
        : bodies.length === 1
          ? `its ${left.length} children`
          : `${left.length} children`;
    const to = bodies.length === 1 ? table().row(bodies[0]).parent : "the remaining bodies";
    ask(
      host,
      `Delete ${some(bodies)}:`,
      answer(host, `attach ${what} to ${to}`, "DeleteBodies", { bodies, children: "attach" }),
      answer(
        host,
        bodies.length === 1 ? "delete its whole branch" : "delete their whole branches",
        "DeleteBodies",
        { bodies, children: "delete" },
      ),
    );
  }

  function howMany() {
    const host = pgraph.host("table"),
      count = cells.input((serial, text) => send("CountBodies", { serial, text }), {
        label: "number of bodies",
      });
    pgraph.front("Bodies");
    cells.set(count, String(table().rows().length));
    ask(host, "Number of bodies, added or removed at the end:", count);
    count.focus();
  }
  pgraph.commands("Model", [["Number of bodies", "", howMany]]);

  return { build, add, duplicate, mirror, remove, close };
})();

// A menu of commands for a body: on its row, its node and in the 3D view; and F6 from pane to pane.
(() => {
  const { make, send } = pgraph;
  const host = (view) => {
    const el = pgraph.host(view);
    return el?.getClientRects().length ? el : null;
  };
  const selected = () => pgraph.latest.selected ?? [];

  // `act` once the body is selected on this page: commands are for all that is selected.
  function selecting(name, act, patience = 100) {
    if (selected().includes(name)) {
      act();
      return;
    }
    if (patience === 100) send("Select", { body: name });
    if (patience) setTimeout(() => selecting(name, act, patience - 1), 30);
  }
  const look = (which) => [
    which === "fit" ? "Frame it" : "Turn about it",
    which === "fit" ? "F" : "C",
    () => pgraph.camera.look(which),
  ];

  const WHEN = [
    ["touches", "touches"],
    ["leaves", "leaves"],
    ["passes", "passes an angle"],
    ["exceeds", "exceeds a force"],
  ];
  function ofBody(name) {
    const rows = pgraph.rows,
      table = host("table"),
      gizmo = pgraph.latest.show?.gizmo,
      one = selected().length < 2 || !selected().includes(name);
    const moving = (what, label, begin = `Move its ${label} in 3D`) => [
      gizmo === what ? `Done with its ${label}` : begin,
      "",
      () => send("SetGizmo", { what: gizmo === what ? "" : what }),
    ];
    return [
      look("fit"),
      look("centre"),
      null,
      ...(one ? [["Add a body on it", "Ctrl+Enter", () => rows.add()]] : []),
      ["Duplicate", "Ctrl+D", () => rows.duplicate(table)],
      ["Mirror", "", () => rows.mirror(table)],
      ["Delete", "Delete", () => rows.remove(table)],
      null,
      ...(one
        ? [
            moving("link", "joint"),
            moving("com", "centre of mass"),
            moving("rotation", "orientation", "Turn it in 3D"),
            null,
          ]
        : []),
      ...(one ? [["Connections", "", () => pgraph.show("Connections", name)]] : []),
      ...(one && pgraph.latest.constraints?.lists[0].items.length
        ? [
            "Switch a constraint when it",
            ...WHEN.map(([when, text]) => [
              text,
              "",
              () => {
                send("AddSwitch", { constraint: null, body: name, when });
                pgraph.front("Scenarios");
              },
            ]),
          ]
        : []),
    ];
  }
  const ofView = () => [
    ["Fit view", "F", () => pgraph.camera.look("fit")],
    ["View from front", "1", () => pgraph.camera.look("front")],
    ["View from the side", "2", () => pgraph.camera.look("side")],
    ["View from the top", "3", () => pgraph.camera.look("top")],
    ["Isometric view", "0", () => pgraph.camera.look("isometric")],
    null,
    ["Measure", "M", () => pgraph.camera.measure()],
  ];

  pgraph.bodyMenu = (name, x, y) => {
    if (name === null) {
      pgraph.menu("3D view", ofView(), x, y);
      return;
    }
    const several = selected().includes(name) && selected().length > 1;
    if (!selected().includes(name)) send("Select", { body: name });
    const items = ofBody(name).map((item) =>
      Array.isArray(item) ? [item[0], item[1], () => selecting(name, item[2])] : item,
    );
    pgraph.menu(several ? `${selected().length} bodies` : name, items, x, y);
  };

  window.addEventListener("contextmenu", (event) => {
    if (event.target.closest?.(".pgraph-menu")) {
      event.preventDefault();
      return;
    }
    const of = event.target.closest?.('[data-view="table"] tr[data-name], svg.digraph g.node');
    if (!of || event.target.dataset?.editing === "1") return; // a cell that is typed in has the browser's own
    event.preventDefault();
    const box = of.getBoundingClientRect(),
      byKey = event.clientX === 0 && event.clientY === 0;
    pgraph.bodyMenu(
      of.dataset.name,
      byKey ? box.left + 40 : event.clientX,
      byKey ? box.bottom : event.clientY,
    );
  });

  // -- panes -------------------------------------------------------------------------------------
  const FIRST =
    'tr.selected, g.node[tabindex="0"], tr[data-name], button.play, button:not(:disabled), input, select, summary';
  const view = () => document.querySelector(".pgraph-views");
  function panes() {
    const { slot } = pgraph.frame,
      views = [...slot("left").querySelectorAll("[data-view]")].map((one) => [one]);
    const all = [
      [slot("top")],
      ...views,
      [slot("drawer")],
      [slot("run"), slot("time"), slot("trust")],
      [slot("right")],
      [view()],
    ];
    return all
      .map((pane) => pane.filter((part) => part?.getClientRects().length))
      .filter((pane) => pane.length);
  }
  function enter(pane) {
    for (const first of FIRST.split(", "))
      for (const part of pane) {
        const found = [...part.querySelectorAll(first)].find((el) => el.getClientRects().length);
        if (found) {
          found.focus();
          return;
        }
      }
  }
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "F6" || event.ctrlKey || event.altKey) return;
      event.preventDefault();
      const all = panes(),
        at = all.findIndex((pane) => pane.some((part) => part.contains(document.activeElement)));
      const n = all.length,
        to = event.shiftKey ? (at < 0 ? n - 1 : (at + n - 1) % n) : (at + 1) % n;
      enter(all[to]);
    },
    true,
  );
})();

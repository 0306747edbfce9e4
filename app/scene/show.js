// The tools of the 3D view: pose by hand, move the selected body's joint, measure; and what is drawn, a
// switch each.
(() => {
  const { make, send, icon } = pgraph;
  const GIZMOS = [
    ["", "nothing"],
    ["link", "joint"],
    ["com", "centre of mass"],
    ["rotation", "orientation"],
  ];

  // Marks that are not listed are of joints.
  const GROUPS = {
    Bodies: ["shapes", "branches", "names", "coms", "inertias", "frames", "sites"],
    "Joints and connections": [],
    Contacts: ["points", "forces", "cones", "footprints"],
    Camera: ["follow"],
  };
  const groupOf = (what) =>
    Object.keys(GROUPS).find((group) => GROUPS[group].includes(what)) ?? "Joints and connections";

  function build(host) {
    const gizmo = make(
      "select",
      {
        className: "cell gizmo",
        "aria-label": "move in 3D",
        onchange: () => send("SetGizmo", { what: gizmo.value }),
      },
      ...GIZMOS.map(([value, textContent]) => make("option", { value, textContent })),
    );
    host.replaceChildren(
      make(
        "div",
        { className: "show" },
        make("div", { className: "switches" }),
        make(
          "div",
          { className: "field" },
          make("div", { className: "what", textContent: "Move in 3D" }),
          gizmo,
        ),
        make("div", { className: "muted why" }),
      ),
    );
    const tool = (name, label, onclick) =>
      make(
        "button",
        {
          className: `bare tool-${name}`,
          title: label,
          "aria-label": label.split(":")[0],
          "aria-pressed": "false",
          onclick,
        },
        icon(name),
      );
    document.querySelector(".pgraph-tools").prepend(
      tool("cursor", "Select and pose: drag a body", () => send("SetGizmo", { what: "" })),
      tool("move", "Move the joint of the selected body", () =>
        send("SetGizmo", { what: pgraph.latest.show.gizmo === "link" ? "" : "link" }),
      ),
      tool("ruler", "Measure: distance and angle between two points (M)", () =>
        pgraph.camera.measure(),
      ),
      make("span", { className: "rule" }),
    );
    if (pgraph.choices.get().dragged) return;
    const hint = make(
      "div",
      { className: "pgraph pgraph-hint" },
      make("b", { textContent: "Drag" }),
      " to pose",
      make("b", { textContent: "Ctrl drag" }),
      " to push",
    );
    pgraph.frame.slot("view").append(hint);
    pgraph.on("joints", ({ posed }) => {
      if (posed) {
        hint.remove();
        pgraph.choices.set({ dragged: true });
      }
    }); // known from now on
  }
  function pressed() {
    const gizmo = pgraph.latest.show?.gizmo,
      measures = pgraph.latest.aim?.wants === "measure";
    for (const [name, on] of [
      ["cursor", !gizmo && !measures],
      ["move", Boolean(gizmo)],
      ["ruler", measures],
    ])
      document.querySelector(`.tool-${name}`)?.setAttribute("aria-pressed", on);
  }

  function draw(host, data) {
    const box = host.querySelector(".switches");
    const known = [...box.querySelectorAll("input")]
      .map((input) => input.dataset.what)
      .sort()
      .join();
    const wanted = data.switches.map(({ what }) => what).sort();
    if (known !== wanted.join()) {
      const row = ({ what, label }) =>
        make(
          "label",
          {},
          make("input", {
            type: "checkbox",
            "data-what": what,
            onchange: (event) => send("Show", { what, on: event.target.checked }),
          }),
          make("span", { textContent: label }),
        );
      box.replaceChildren(
        ...Object.keys(GROUPS).flatMap((group) => {
          const own = data.switches.filter(({ what }) => groupOf(what) === group);
          return own.length ? [make("h4", { textContent: group }), ...own.map(row)] : [];
        }),
      );
    }
    data.switches.forEach(({ what, on }) => {
      box.querySelector(`[data-what="${what}"]`).checked = on;
    });
    host.querySelector(".gizmo").value = data.gizmo;
    const why = host.querySelector(".why");
    why.hidden = !data.gizmo;
    why.textContent = data.selected
      ? `Drag the arrows at ${data.selected}: one undo step.`
      : "Select a body first.";
    pressed();
  }

  pgraph.view("show", { build, show: draw, aim: pressed });
})();

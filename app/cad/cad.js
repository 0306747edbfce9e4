// A CAD assembly beside the 3D view: its parts with their densities, and the proposed joints, of
// which the user accepts some. A line selects its bodies, and so shows them in the 3D view.
(() => {
  const { make, send, button } = pgraph;

  pgraph.on("assembly", (found) => {
    document.querySelector("dialog.pgraph-cad")?.remove();
    if (!found) return; // another model was opened
    const parts = found.parts.map(partLine),
      joints = found.joints.map((joint) => jointLine(joint, found.kinds));
    const accept = () =>
      send("AcceptJoints", {
        joints: joints.flatMap(({ box, kind }, k) => (box.checked ? [[k, kind.value]] : [])),
        densities: parts.flatMap(({ name, density }) =>
          density.value.trim() ? [[name, density.value]] : [],
        ),
        fixed: parts.flatMap(({ name, fixed }) => (fixed.checked ? [name] : [])),
      });
    const all = make("input", {
      type: "text",
      className: "cell",
      placeholder: "of all",
      "aria-label": "density of all parts",
      oninput: () => parts.forEach(({ density }) => (density.value = all.value)),
    });
    const sheet = make(
      "dialog",
      {
        className: "pgraph pgraph-cad",
        "aria-label": "CAD assembly",
        onclose: () => sheet.remove(),
      },
      make("strong", { textContent: found.file }),
      make(
        "div",
        { className: "parts" },
        make("span", { className: "muted", textContent: `${parts.length} parts` }),
        make("span", { className: "muted", textContent: "Volume" }),
        make("span", { className: "muted", textContent: "Density kg/m³" }),
        make("span", { className: "muted", textContent: "Fixed" }),
        make("span"),
        make("span"),
        all,
        make("span"),
        ...parts.flatMap(({ cells }) => cells),
      ),
      make("div", {
        className: "muted",
        textContent: joints.length
          ? `${joints.length} joints are proposed; those with a check mark are accepted.`
          : "No joints are proposed: no two parts fit or touch.",
      }),
      make("div", { className: "joints" }, ...joints.map(({ line }) => line)),
      make(
        "div",
        { className: "ask" },
        button("primary accept", "Accept", "Make the model with these joints", accept),
        button("close", "Close", "Keep the model as it is", () => sheet.close()),
      ),
    );
    document.body.append(sheet);
    sheet.show();
  });

  function partLine({ name, volume, density: given }) {
    const density = make("input", {
      type: "text",
      className: "cell",
      value: given,
      placeholder: "1000",
      "aria-label": `density of ${name}`,
    });
    const fixed = make("input", { type: "checkbox", "aria-label": `${name} is fixed` });
    const title = button("bare part", name, `Select ${name}`, () => send("Select", { body: name }));
    const cells = [
      title,
      make("span", { className: "muted", textContent: volume }),
      density,
      fixed,
    ];
    return { name, density, fixed, cells };
  }

  function jointLine(joint, kinds) {
    const [first, second] = joint.bodies,
      label = `joint of ${first} and ${second}`;
    const box = make("input", { type: "checkbox", checked: joint.selected, "aria-label": label });
    const kind = make(
      "select",
      {
        className: "cell",
        "aria-label": `kind of the ${label}`,
        onchange: () => (box.checked = true),
      },
      ...kinds.map((name) => make("option", { textContent: name, selected: name === joint.kind })),
    );
    const show = () => send("SelectBodies", { body: second, bodies: [first, second] });
    const words = button("bare words", `${first} – ${second}`, "Select both bodies", show);
    const about = [joint.evidence, joint.gap].filter(Boolean).join(", ");
    const line = make(
      "div",
      { className: "proposal", onmouseenter: show },
      box,
      kind,
      words,
      make("span", { className: "muted", textContent: about }),
    );
    return { box, kind, line };
  }
})();

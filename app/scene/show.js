// What is drawn in 3D, a switch each, and what of the selected body the gizmo moves.
(() => {
  const { make, send } = pgraph;
  const GIZMOS = [["", "nothing"], ["link", "link vector"], ["com", "centre of mass"], ["rotation", "orientation"]];

  function build(host) {
    const gizmo = make("select", { className: "cell gizmo", "aria-label": "move in 3D", onchange: () => send("SetGizmo", { what: gizmo.value }) },
      ...GIZMOS.map(([value, textContent]) => make("option", { value, textContent })));
    host.replaceChildren(make("div", { className: "show" }, make("div", { className: "switches" }),
      make("div", { className: "field" }, make("div", { className: "what", textContent: "Move in 3D" }), gizmo), make("div", { className: "muted why" })));
  }

  function draw(host, data) {
    const box = host.querySelector(".switches");
    const known = [...box.querySelectorAll("input")].map((input) => input.dataset.what).join();
    if (known !== data.switches.map(({ what }) => what).join()) {
      box.replaceChildren(...data.switches.map(({ what, label }) => make("label", {}, make("input", {
        type: "checkbox", "data-what": what, onchange: (event) => send("Show", { what, on: event.target.checked }),
      }), label)));
    }
    data.switches.forEach(({ what, on }) => { box.querySelector(`[data-what="${what}"]`).checked = on; });
    host.querySelector(".gizmo").value = data.gizmo;
    const why = host.querySelector(".why");
    why.hidden = !data.gizmo;
    why.textContent = data.selected ? `Drag the arrows at ${data.selected}: one undo step.` : "Select a body first.";
  }

  pgraph.view("show", { build, show: draw });

  // An arrow is seen through the body that it acts on: drawn last, over all, in a colour that the light leaves it.
  for (const arrows of ["/forces", "/loads", "/pull"]) {
    pgraph.viser.materials(arrows, (material) => {
      if (!material.depthTest) return;
      Object.assign(material, { depthTest: false, transparent: true, needsUpdate: true });
      material.color.setScalar(0.3);
    });
  }
  // From below the floor is not drawn; its triangles are turned so that its back is above.
  const BACK = 1; // of three.js
  for (const floor of ["/floor", "/ground"]) {
    pgraph.viser.materials(floor, (material) => { if (material.side !== BACK) Object.assign(material, { side: BACK, needsUpdate: true }); });
  }
})();

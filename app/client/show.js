// What is drawn over the bodies, as switches.
(() => {
  const { make, send } = pgraph;
  const SHOW = [
    ["axes", "joint axes"], ["links", "link vectors"], ["coms", "centres of mass"],
    ["names", "names"], ["forces", "constraint forces"],
  ];

  function build(host) {
    host.replaceChildren(make("fieldset", { className: "show" }, make("legend", { textContent: "Show" }),
      ...SHOW.map(([what, label]) => make("label", {}, make("input", {
        type: "checkbox", "data-what": what,
        onchange: (event) => send("Show", { what, on: event.target.checked }),
      }), label))));
  }

  function draw(host, shown) {
    for (const box of host.querySelectorAll("[data-what]")) box.checked = shown.includes(box.dataset.what);
  }

  pgraph.view("show", { build, show: draw });
})();

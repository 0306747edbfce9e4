// The camera: buttons over the 3D view, keys, the camera that goes along, and what it turns about.
pgraph.camera = (() => {
  const { make, send } = pgraph;
  const VIEWS = [
    ["fit", "Fit view", "F", "M1 5V1h4M11 1h4v4M15 11v4h-4M5 15H1v-4", "what is selected, or all"],
    ["front", "View from front", "1", "M3 3h10v10H3z"],
    ["side", "View from the side", "2", "M3 5l8-2v8l-8 2zM11 3l3 2v6l-3 0"],
    ["top", "View from the top", "3", "M2 6l6-3 6 3-6 3zM2 6v4l6 3 6-3V6"],
    ["isometric", "Isometric view", "0", "M8 1l6 3.5v7L8 15l-6-3.5v-7zM8 8l6-3.5M8 8v7M8 8L2 4.5"],
  ];
  const CENTRE = ["centre", "Turn about the selection", "C", "M8 1v4M8 11v4M1 8h4M11 8h4M8 6a2 2 0 1 0 .01 0z", "it comes to the middle, from where you look"];
  const KEYS = Object.fromEntries([...VIEWS, CENTRE].map(([which, , key]) => [key.toLowerCase(), which]));
  const look = (which) => send("View", { which });

  function picture(path) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", "0 0 16 16");
    const line = document.createElementNS("http://www.w3.org/2000/svg", "path");
    line.setAttribute("d", path);
    svg.append(line);
    return svg;
  }
  const measure = () => pgraph.picking.start("measure");
  function bar() {
    if (document.querySelector(".pgraph-views")) return;
    const button = ([which, label, key, path, more]) => make("button", {
      className: `view-${which}`, title: `${label}${more ? `: ${more}` : ""} (${key})`, "aria-label": label, onclick: () => look(which),
    }, picture(path));
    document.body.append(make("div", { className: "pgraph pgraph-views", role: "toolbar", "aria-label": "3D view" }, ...VIEWS.map(button), button(CENTRE),
      make("button", { className: "view-measure", title: "Measure: distance and angle between two points (M)", "aria-label": "Measure", "aria-pressed": "false", onclick: measure },
        picture("M1 11L11 1l4 4L5 15zM4 8l2 2M6.5 5.5L8 7M9 3l2 2"))));
  }
  bar();

  // The 3D view has the focus where nothing else has it.
  const inView = () => document.activeElement === document.body || document.activeElement?.closest?.(".pgraph-views")
    || document.activeElement?.querySelector?.("canvas:not(.pgraph *)");
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || !inView()) return;
    const key = event.key.toLowerCase(), which = KEYS[key];
    if (!which && key !== "m") return;
    event.preventDefault();
    if (which) look(which); else measure();
  });

  // The animal moved: the camera and what it looks at move by as much, so that a page that turns
  // its view meanwhile loses nothing.
  let last = null;
  pgraph.on("follow", (at) => {
    const controls = window.__viserMutable?.cameraControl;
    if (at.length && last && controls) pgraph.viser.shift(at.map((x, k) => x - last[k]));
    last = at.length ? at : null;
  });
  // A camera that a person has moved is not set again when the view gets another shape.
  let turned = false, watched = null;
  (function watch() {
    const controls = window.__viserMutable?.cameraControl;
    if (controls && controls.camera !== watched) { // made again after a lost connection
      watched = controls.camera;
      controls.addEventListener("control", () => { if (!turned) turn(true); });
    }
    setTimeout(watch, controls ? 2000 : 100);
  })();
  function turn(by) {
    turned = by;
    pgraph.tellView();
  }
  // A camera that is set anew is set for where the animal is now.
  pgraph.on("framed", () => { last = null; if (turned) turn(false); });
  return { look, measure, turned: () => turned };
})();

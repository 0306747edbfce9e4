// The camera: the axes that turn it, keys, and how it goes along with what travels.
pgraph.camera = (() => {
  const { make, send, svg, viser } = pgraph;
  const KEYS = { f: "fit", 1: "front", 2: "side", 3: "top", 0: "isometric", c: "centre" };
  const look = (which) => send("View", { which });
  const measure = () => pgraph.picking.start("measure");

  // -- the axes: a click looks along one, a drag turns ----------------------------------------------
  const HALF = 32,
    REACH = 22,
    PER_PIXEL = 0.012; // [px], [px], [rad]
  const AXES = ["x", "y", "z"].flatMap((axis, k) =>
    [1, -1].map((sign) => ({
      axis,
      which: sign > 0 ? axis : `-${axis}`,
      way: [0, 1, 2].map((i) => (i === k ? sign : 0)),
      sign,
    })),
  );
  function gizmo() {
    const box = svg(
      "svg",
      {
        class: "axes",
        viewBox: "0 0 64 64",
        width: 64,
        height: 64,
        role: "group",
        "aria-label": "directions of the view",
      },
      svg("circle", { class: "disc", cx: HALF, cy: HALF, r: HALF - 0.5 }),
    );
    const lines = svg("g", {});
    box.append(lines);
    for (const one of AXES) {
      const { axis, which, sign } = one;
      one.line = sign > 0 ? svg("line", { class: `axis ${axis}`, x1: HALF, y1: HALF }) : null;
      if (one.line) lines.append(one.line);
      one.end = svg("circle", { r: sign > 0 ? 7 : 5 });
      one.reach = svg("circle", { class: "reach", r: 13 });
      one.text = sign > 0 ? svg("text", { dy: 3 }, axis) : null;
      one.group = svg(
        "g",
        {
          class: `axis ${axis}${sign > 0 ? "" : " minus"}`,
          ...(sign > 0 ? { role: "button", tabindex: 0, "aria-label": `view from ${which}` } : {}),
          "data-which": which,
        },
        svg("title", {}, `View from ${which}`),
        ...[one.end, one.text, one.reach].filter(Boolean),
      );
      one.group.addEventListener("keydown", (event) => {
        if (event.key === "Enter") look(which);
      });
      box.append(one.group);
    }
    let from = null,
      dragged = false;
    box.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY];
      dragged = false;
    });
    box.addEventListener("pointermove", ({ clientX, clientY, buttons, pointerId }) => {
      if (!from || !buttons) return;
      const [dx, dy] = [clientX - from[0], clientY - from[1]];
      if (!dragged && Math.hypot(dx, dy) < 4) return;
      if (!dragged) box.setPointerCapture(pointerId);
      dragged = true;
      from = [clientX, clientY];
      viser.controls()?.rotate(-PER_PIXEL * dx, -PER_PIXEL * dy, false);
      if (!turned) turn(true);
    });
    box.addEventListener("click", (event) => {
      const which = event.target.closest("g.axis")?.dataset.which;
      if (which && !dragged) look(which);
    });
    return box;
  }
  let drawn = "";
  viser.frame(() => {
    const m = viser.controls()?.camera.matrixWorldInverse.elements;
    if (!m) return;
    const seen = AXES.map(({ way }) => {
      const [x, y, z] = viser.turned(way);
      return [0, 1, 2].map((k) => m[k] * x + m[4 + k] * y + m[8 + k] * z);
    });
    const now = seen
      .flat()
      .map((v) => v.toFixed(2))
      .join();
    if (now === drawn) return;
    drawn = now;
    const box = AXES[0].group.parentNode;
    AXES.forEach((one, i) => {
      const x = HALF + REACH * seen[i][0],
        y = HALF - REACH * seen[i][1];
      for (const [el, ...named] of [
        [one.line, "x2", "y2"],
        [one.reach, "cx", "cy"],
        [one.end, "cx", "cy"],
        [one.text, "x", "y"],
      ]) {
        el?.setAttribute(named[0], x.toFixed(1));
        el?.setAttribute(named[1], y.toFixed(1));
      }
    });
    const order = AXES.map((_, i) => i)
      .sort((a, b) => seen[a][2] - seen[b][2])
      .map((i) => AXES[i].group); // the nearest last
    if (
      order.some((group, i) => box.children[i + 2] !== group) &&
      !box.contains(document.activeElement)
    )
      box.append(...order);
  });

  document.body.append(
    make(
      "div",
      { className: "pgraph pgraph-views", role: "toolbar", "aria-label": "3D view" },
      gizmo(),
      make(
        "button",
        {
          className: "view-fit",
          title: "Fit the selection, or everything (F)",
          "aria-label": "Fit view",
          onclick: () => look("fit"),
        },
        pgraph.icon("fit"),
      ),
    ),
  );

  // The 3D view has the focus where nothing else has it.
  const isView = (el) =>
    el === document.body ||
    el?.closest?.(".pgraph-views") ||
    el?.querySelector?.("canvas:not(.pgraph *)");
  window.addEventListener("keydown", (event) => {
    if (
      event.ctrlKey ||
      event.metaKey ||
      event.altKey ||
      event.shiftKey ||
      !isView(document.activeElement)
    )
      return;
    const key = event.key.toLowerCase(),
      which = KEYS[key];
    if (!which && key !== "m") return;
    event.preventDefault();
    if (which) look(which);
    else measure();
  });
  window.addEventListener("dblclick", ({ target, clientX, clientY }) => {
    const at =
      target.tagName === "CANVAS" &&
      !target.closest(".pgraph") &&
      pgraph.picking.ray(clientX, clientY);
    if (at) send("FrameSpot", at);
  });

  // The model moved, and a node with it: the camera and what it looks at move by as much, so that
  // a page that turns its view meanwhile loses nothing.
  let followed = null,
    last = null,
    follows = true;
  pgraph.on("follow", (on) => {
    follows = on;
  });
  viser.frame(() => {
    const at = window.__viserMutable?.nodeRefFromName[followed]?.position.toArray();
    if (!at || !viser.controls()) return;
    const way = at.map((x, k) => x - last[k]);
    if (follows && way.some(Boolean)) viser.shift(way);
    last = at;
  });
  // A camera that a person has moved is not set again when the view gets another shape.
  let turned = false,
    watched = null;
  (function watch() {
    const controls = viser.controls();
    if (controls && controls.camera !== watched) {
      // made again after a lost connection
      watched = controls.camera;
      controls.addEventListener("control", () => {
        if (!turned) turn(true);
      });
    }
    setTimeout(watch, controls ? 2000 : 100);
  })();
  function turn(by) {
    turned = by;
    pgraph.tellView();
  }
  // A camera that is set anew is set for where the model is now: a node of an older model moves it no longer.
  pgraph.on("framed", ([node, at]) => {
    [followed, last] = [node, at];
    if (turned) turn(false);
    [from, ease] = [viser.controls() && seen(), null];
  });

  // Then it goes there in a moment: of the way back to where it was, less and less is added to each picture.
  const TAKES = 450,
    CALM = matchMedia("(prefers-reduced-motion: reduce)"); // [ms]
  let from = null,
    ease = null;
  const seen = () => {
    const m = viser.controls(),
      v = m.camera.position;
    return [m.getPosition(v.clone()), m.getTarget(v.clone())];
  };
  pgraph.on("eased", () => {
    if (!from || CALM.matches) return;
    ease = { way: seen().map((at, k) => from[k].sub(at)), rest: 0, begun: performance.now() };
  });
  viser.frame(() => {
    if (!ease) return;
    const s = Math.min((performance.now() - ease.begun) / TAKES, 1),
      rest = (1 - s) ** 3;
    const [[x, y, z], [u, v, w]] = seen().map((at, k) =>
      at.addScaledVector(ease.way[k], rest - ease.rest).toArray(),
    );
    viser.controls().setLookAt(x, y, z, u, v, w, false);
    viser.controls().update(0);
    ease = s < 1 && !turned ? { ...ease, rest } : null;
    requestAnimationFrame(() => window.__viserMutable?.requestRender());
  });
  return { look, measure, turned: () => turned };
})();

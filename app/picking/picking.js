// Picking in the 3D view: a ray for each place of the pointer; marks and a sentence over the view.
pgraph.picking = (() => {
  const { make, button, send } = pgraph;
  const SNAP = 12; // [px] within which corners, ends and centres are pointed at
  const CLICK = 4; // [px] that a click may move; beyond it turns the view
  const PACE = 60; // [ms] between places of the pointer that are told
  const canvas = () => document.querySelector("canvas:not(.pgraph *)");
  const inView = (el) =>
    el?.contains?.(canvas()) || (el?.tagName === "CANVAS" && !el.closest(".pgraph")); // viser draws over it
  let aim = null,
    layer = null,
    down = null,
    told = 0,
    later = null,
    frame = 0;

  // -- between the page and the world, whose axes differ from three.js's by the root's rotation ----
  const root = () => window.__viserSceneTree?.getState()[""]?.wxyz ?? [1, 0, 0, 0];
  function back([x, y, z]) {
    const [w, a, b, c] = root();
    const [u, v, t] = [2 * (c * y - b * z), 2 * (a * z - c * x), 2 * (b * x - a * y)];
    return [x + w * u + c * v - b * t, y + w * v + a * t - c * u, z + w * t + b * u - a * v];
  }
  function ray(clientX, clientY) {
    const camera = window.__viserMutable?.camera,
      box = canvas()?.getBoundingClientRect();
    if (!camera || !box) return null;
    const m = camera.matrixWorld.elements,
      tan = Math.tan((camera.fov * Math.PI) / 360);
    const x = ((2 * (clientX - box.left)) / box.width - 1) * tan * (box.width / box.height);
    const y = (1 - (2 * (clientY - box.top)) / box.height) * tan;
    const direction = [0, 1, 2].map((k) => m[k] * x + m[4 + k] * y - m[8 + k]);
    return {
      origin: back([m[12], m[13], m[14]]),
      direction: back(direction),
      slack: (2 * SNAP * tan) / box.height,
    };
  }
  // Where a point is on the page; null behind the camera.
  function projected(point) {
    const camera = window.__viserMutable?.camera,
      box = canvas()?.getBoundingClientRect();
    if (!camera || !box) return null;
    const [x, y, z] = pgraph.viser.turned(point),
      v = camera.matrixWorldInverse.elements;
    const [a, b, c] = [0, 1, 2].map((k) => v[k] * x + v[4 + k] * y + v[8 + k] * z + v[12 + k]);
    if (c >= 0) return null;
    const tan = Math.tan((camera.fov * Math.PI) / 360),
      half = box.height / 2;
    return [
      box.left + box.width / 2 + ((a / -c) * half) / tan,
      box.top + half - ((b / -c) * half) / tan,
    ];
  }

  // -- the pointer -----------------------------------------------------------------------------------
  window.addEventListener(
    "pointermove",
    (event) => {
      if (!aim || !inView(event.target) || event.buttons) return;
      clearTimeout(later);
      const tell = () => {
        const at = ray(event.clientX, event.clientY);
        told = performance.now();
        if (at && aim) send("Hover", at);
      };
      if (performance.now() - told > PACE) tell();
      else later = setTimeout(tell, PACE); // the last place is told too
    },
    true,
  );
  window.addEventListener(
    "pointerdown",
    (event) => {
      down = inView(event.target) ? [event.clientX, event.clientY, event.button] : null;
    },
    true,
  );
  const still = (event) =>
    down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) <= CLICK;
  window.addEventListener(
    "pointerup",
    (event) => {
      const at = event.button === 0 && still(event) && ray(event.clientX, event.clientY);
      if (at) send(...(aim ? ["ClickSpot", { ...at, rate: event.shiftKey }] : ["ClickView", at]));
    },
    true,
  );
  // The right button moves the view; where it has not moved, it asks for the menu of what is there.
  window.addEventListener(
    "contextmenu",
    (event) => {
      if (!inView(event.target)) return;
      event.preventDefault();
      const at = still(event) && ray(event.clientX, event.clientY);
      if (at) send("AskBody", { ...at, at: [event.clientX, event.clientY] });
    },
    true,
  );
  pgraph.on("menuOf", ({ body, at }) => pgraph.bodyMenu(body, ...at));

  // -- texts and marks -----------------------------------------------------------------------
  function start(wants, of = {}) {
    if (aim?.wants === wants && wants === "measure") {
      send("EndAim");
      return;
    }
    send("StartAim", { wants, ...of });
  }
  function draw(data) {
    const another =
      !data || !aim || aim.asks !== data.asks || String(aim.measured) !== String(data.measured);
    aim = data;
    document.body.classList.toggle("pgraph-aiming", Boolean(aim));
    if (another) banner();
    if (!aim) {
      layer?.remove();
      layer = null;
      return;
    }
    if (!layer) {
      layer = pgraph.svg("svg", { class: "pgraph-marks", "aria-hidden": "true" });
      document.body.append(layer);
      cancelAnimationFrame(frame);
      follow();
    }
  }
  function banner() {
    document.querySelector(".pgraph-aim")?.remove();
    if (!aim) return;
    const values = aim.measured.map(([what, text]) =>
      make(
        "span",
        { className: "value" },
        make("span", { className: "muted", textContent: `${what} ` }),
        text,
      ),
    );
    document.body.append(
      make(
        "div",
        { className: "pgraph pgraph-banner pgraph-aim", role: "status" },
        ...(values.length ? values : [make("span", { textContent: aim.asks, title: aim.asks })]),
        button("small", values.length ? "Close" : "Cancel", "Escape", () => send("EndAim")),
      ),
    );
  }
  // Marks keep to their points while the camera moves.
  function follow() {
    if (!layer || !aim) return;
    const { svg } = pgraph,
      places = aim.marks.map(({ at }) => projected(at));
    const made = places.flatMap((place, i) => {
      if (!place) return [];
      const [x, y] = place.map((v) => v.toFixed(1)),
        dot = svg("circle", { cx: x, cy: y, r: 5 });
      const { at, along } = aim.marks[i],
        end = along && projected(at.map((v, k) => v + 1e-3 * along[k]));
      const far = end && Math.hypot(end[0] - place[0], end[1] - place[1]);
      const arrow =
        far > 1e-6
          ? [
              svg("path", {
                d: `M${x} ${y} l${[0, 1].map((k) => ((28 * (end[k] - place[k])) / far).toFixed(1)).join(" ")}`,
              }),
            ]
          : [];
      return [...arrow, dot];
    });
    if (places.length > 1 && places[0] && places[1])
      made.unshift(
        svg("path", { class: "gap", d: `M${places[0].join(" ")} L${places[1].join(" ")}` }),
      );
    const last = places.at(-1);
    if (aim.under && last) {
      const box = canvas().getBoundingClientRect(),
        left = last[0] < box.left + box.width / 2;
      const text = svg(
        "text",
        { x: last[0] + (left ? 9 : -9), y: last[1] - 9, "text-anchor": left ? "start" : "end" },
        aim.under,
      );
      made.push(text);
    }
    layer.replaceChildren(...made);
    frame = requestAnimationFrame(follow);
  }
  pgraph.on("aim", draw);
  return { start, ray, projected };
})();

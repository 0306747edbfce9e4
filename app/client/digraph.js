// The digraph as SVG, and the Pgraph and jdof vectors above it; every entry selects its body.
(() => {
  const { make } = pgraph;
  const NS = "http://www.w3.org/2000/svg";
  const RADIUS = 11;
  const svg = (tag, attributes = {}, ...children) => {
    const el = document.createElementNS(NS, tag);
    for (const [key, value] of Object.entries(attributes)) el.setAttribute(key, value);
    el.append(...children);
    return el;
  };
  const view = new WeakMap(); // svg -> {x, y, scale}

  function build(host) {
    const canvas = svg("svg", { class: "digraph", role: "group", "aria-label": "digraph of the bodies" });
    host.replaceChildren(make("div", { className: "vectors" }), canvas,
      make("div", { className: "legend muted" }, "double ring: separation body, dashed ring: tip, dashed line: constraint"));
    panAndZoom(canvas);
    fillPanel(host, canvas);
    new ResizeObserver(() => {
      if (!host.pgraphData) return;
      if (view.get(canvas)?.moved) apply(canvas); else fit(canvas, host.pgraphData);
    }).observe(canvas);
  }

  // The picture takes the height that the vectors leave in the scrolling panel around it.
  function fillPanel(host, canvas) {
    let panel = host.parentElement;
    while (panel && !["scroll", "auto"].includes(getComputedStyle(panel).overflowY)) panel = panel.parentElement;
    if (!panel) return;
    const resize = () => {
      const rest = host.offsetHeight - canvas.clientHeight + 14;
      canvas.style.height = `${Math.max(panel.clientHeight - rest, 150)}px`;
    };
    const watch = new ResizeObserver(resize);
    watch.observe(panel);
    watch.observe(host.firstElementChild);
  }

  const select = (name) => pgraph.send("Select", { body: name });

  function draw(host, data) {
    const canvas = host.querySelector("svg");
    const anew = !host.pgraphData || host.pgraphData.names.length !== data.names.length;
    host.pgraphData = data;
    vectors(host.querySelector(".vectors"), data);
    canvas.replaceChildren(...edges(data), ...loops(data), ground(data), ...nodes(data));
    if (anew) fit(canvas, data);
    mark(host, pgraph.latest.selection);
  }

  function vectors(box, data) {
    const entry = (k, i) => {
      const name = k > 0 ? data.names[k - 1] : "ground";
      const again = data.pgraph.indexOf(k) < i || k === 0;
      return make("button", {
        className: again ? "entry again" : "entry", title: again ? `back to ${name}` : name,
        onclick: () => select(k > 0 ? name : null), "data-name": k > 0 ? name : "",
      }, make("span", { textContent: k }), make("span", { textContent: data.jdof[i] }));
    };
    box.replaceChildren(
      make("div", { className: "entry names" }, make("span", { textContent: "Pgraph" }), make("span", { textContent: "jdof" })),
      ...data.pgraph.map(entry));
  }

  function edges(data) {
    return data.parent.map((p, i) => {
      const k = i + 1, x0 = data.x[p], y0 = data.y[p], x1 = data.x[k], y1 = data.y[k];
      const path = data.kind === "tree"
        ? `M${x0} ${y0} C${x0} ${y0 + 24} ${x1} ${y1 - 26} ${x1} ${y1 - RADIUS}`
        : `M${x0} ${y0} V${y1 - 22} L${x1} ${y1}`;
      const dof = svg("text", { class: "dof", x: x1 + 4, y: y1 - RADIUS - 4 });
      dof.textContent = data.kind === "tree" ? data.dof[i] : "";
      return svg("g", { class: "edge", "data-edge": data.names[i] }, svg("path", { d: path }), dof);
    });
  }

  // A constraint: to the ground as a mark below the node, to another body as a dashed line.
  function loops(data) {
    return data.loops.map(({ name, body, other }) => {
      const x = data.x[body], y = data.y[body];
      const g = svg("g", { class: "loop" }, titled(name));
      if (other === 0) {
        const side = data.kind === "tree" ? [x, y + RADIUS + 4] : [x - 8, y + RADIUS - 5];
        g.append(svg("path", { class: "mark", d: hatch(...side) }));
      } else {
        const bend = Math.min(x, data.x[other]) - 26;
        g.append(svg("path", { d: `M${x} ${y} C${bend} ${y} ${bend} ${data.y[other]} ${data.x[other]} ${data.y[other]}` }));
      }
      return g;
    });
  }
  const hatch = (x, y) => `M${x - 8} ${y} h16 M${x - 5} ${y + 3} h10 M${x - 2} ${y + 6} h4`;
  function titled(text) { const t = svg("title"); t.textContent = text; return t; }

  function ground(data) {
    const x = data.x[0], y = data.y[0];
    const text = svg("text", { class: "label muted", x: x + 14, y: y + 4 });
    text.textContent = "ground";
    return svg("g", { class: "ground" }, svg("path", { d: hatch(x, y) }), text);
  }

  function nodes(data) {
    const right = Math.max(...data.x) + RADIUS + 7;
    return data.names.map((name, i) => {
      const k = i + 1, x = data.x[k], y = data.y[k];
      const number = svg("text", { class: "number", x, y: y + 3.5 });
      number.textContent = k;
      const label = svg("text", { class: "label", x: data.kind === "tree" ? x + RADIUS + 5 : right, y: y + 4 });
      label.textContent = name.length > 20 ? `${name.slice(0, 19)}…` : name;
      const kind = data.tips.includes(k) ? " tip" : data.separation.includes(k) ? " separation" : "";
      const g = svg("g", {
        class: `node${kind}`, "data-name": name, tabindex: 0, role: "button", "aria-label": `${k} ${name}`,
        style: `--body: ${data.colors[i]}`,
      }, titled(name));
      if (kind === " separation") g.append(svg("circle", { class: "outer", cx: x, cy: y, r: RADIUS + 3 }));
      g.append(svg("circle", { cx: x, cy: y, r: RADIUS }), number, label);
      g.addEventListener("click", () => select(name));
      g.addEventListener("keydown", (event) => { if (event.key === "Enter") select(name); });
      return g;
    });
  }

  function mark(host, selection) {
    for (const el of host.querySelectorAll(".selected")) el.classList.remove("selected");
    for (const el of host.querySelectorAll("[data-name], [data-edge]")) {
      const own = el.dataset.name ?? el.dataset.edge;
      if (selection && own === selection) { el.classList.add("selected"); reveal(el); }
    }
  }
  function reveal(el) {
    if (el.matches("button.entry")) { el.scrollIntoView({ block: "nearest" }); return; }
    const canvas = el.ownerSVGElement, v = canvas && view.get(canvas);
    const circle = v && el.querySelector("circle");
    if (!circle) return;
    const height = canvas.clientHeight / v.scale, y = Number(circle.getAttribute("cy"));
    if (y < v.y + 20 || y > v.y + height - 20) { v.y = y - height / 2; apply(canvas); }
  }

  // -- pan and zoom by the viewBox: drag, wheel, double click fits -----------------------------
  function fit(canvas, data) {
    const w = canvas.clientWidth || 400, h = canvas.clientHeight || 300;
    const both = Math.min(w / data.width, h / data.height, 1.15);
    const scale = data.kind === "lanes" ? Math.min(w / data.width, 1) : both;
    const x = data.kind === "tree" ? (data.width - w / scale) / 2 : -4;
    view.set(canvas, { x, y: Math.min(0, (data.height - h / scale) / 2), scale: Math.max(scale, 0.3) });
    apply(canvas);
  }
  function apply(canvas) {
    const { x, y, scale } = view.get(canvas);
    canvas.setAttribute("viewBox", `${x} ${y} ${canvas.clientWidth / scale} ${canvas.clientHeight / scale}`);
  }
  function panAndZoom(canvas) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => { from = { x: event.clientX, y: event.clientY }; });
    window.addEventListener("pointerup", () => { from = null; });
    canvas.addEventListener("pointermove", (event) => {
      const v = view.get(canvas);
      if (!from || !v) return;
      v.x -= (event.clientX - from.x) / v.scale;
      v.y -= (event.clientY - from.y) / v.scale;
      v.moved = true;
      from = { x: event.clientX, y: event.clientY };
      apply(canvas);
    });
    canvas.addEventListener("wheel", (event) => {
      const v = view.get(canvas);
      if (!v) return;
      event.preventDefault();
      const box = canvas.getBoundingClientRect(), factor = Math.exp(-event.deltaY / 500);
      const scale = Math.min(Math.max(v.scale * factor, 0.1), 4);
      v.x += (event.clientX - box.left) * (1 / v.scale - 1 / scale);
      v.y += (event.clientY - box.top) * (1 / v.scale - 1 / scale);
      Object.assign(v, { scale, moved: true });
      apply(canvas);
    }, { passive: false });
    canvas.addEventListener("dblclick", () => {
      const data = canvas.closest(".pgraph").pgraphData;
      if (data) fit(canvas, data);
    });
  }

  pgraph.view("digraph", { build, digraph: draw, selection: mark });
})();

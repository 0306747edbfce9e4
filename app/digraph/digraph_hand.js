// The pointer on the digraph: pan, zoom, hover, and a node dragged onto another.
pgraph.digraphHand = (host, canvas, graph) => {
  const PULLED = 5; // [px] from where a press is a drag
  const SMALLEST = 0.45; // scale of all of a tree
  const NAME = 90; // [px] right of a node: its name
  const view = { x: 0, y: 0, scale: 1, moved: false, all: false };
  let press = null; // {x, y, k, dragging, offered}

  // -- the part that is seen ------------------------------------------------------------------
  // At first in the letters of the page, and wider than the panel if need be, which scrolls; where all is asked for, all.
  canvas.fit = (all = false) => {
    const data = host.graph?.data;
    if (!data) return;
    view.all = all;
    canvas.style.width = all ? "" : `max(100%, ${Math.floor(data.width)}px)`;
    const w = canvas.clientWidth || 400, h = canvas.clientHeight || 300;
    view.scale = all ? Math.max(Math.min(w / data.width, h / data.height, 1), SMALLEST) : 1;
    view.x = (data.width - w / view.scale) / 2;
    if (data.width * view.scale > w) view.x = Math.min(data.x[0] - w / view.scale / 2, data.width - w / view.scale);
    view.y = Math.min(0, (data.height - h / view.scale) / 2);
    view.moved = false;
    apply();
    scrollTo(data.x[0]);
  };
  function scrollTo(x) {
    const sheet = canvas.parentElement, at = (x - view.x) * view.scale;
    if (at < sheet.scrollLeft + 15 || at > sheet.scrollLeft + sheet.clientWidth - NAME) sheet.scrollLeft = at - sheet.clientWidth / 2;
  }
  canvas.reveal = (x, y) => {
    const w = canvas.clientWidth / view.scale, h = canvas.clientHeight / view.scale;
    if (!w || !h) return;
    if (y < view.y + 20 || y > view.y + h - 20) view.y = y - h / 2;
    if (x < view.x + 15 || x > view.x + w - 15) view.x = x - w / 2;
    apply();
    scrollTo(x);
  };
  function apply() {
    canvas.setAttribute("viewBox", `${view.x} ${view.y} ${canvas.clientWidth / view.scale} ${canvas.clientHeight / view.scale}`);
  }
  function zoom(event, factor) {
    const box = canvas.getBoundingClientRect(), scale = Math.min(Math.max(view.scale * factor, 0.1), 4);
    view.x += (event.clientX - box.left) * (1 / view.scale - 1 / scale);
    view.y += (event.clientY - box.top) * (1 / view.scale - 1 / scale);
    Object.assign(view, { scale, moved: true });
    apply();
  }
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(event, Math.exp(-event.deltaY / 500));
  }, { passive: false });
  canvas.addEventListener("dblclick", () => canvas.fit(true));
  new ResizeObserver(() => { if (view.moved) apply(); else canvas.fit(view.all); }).observe(canvas);

  // -- press, move, release ---------------------------------------------------------------------
  const at = (event) => document.elementFromPoint(event.clientX, event.clientY)?.closest?.("svg.digraph g[data-number]");
  const numberAt = (event) => { const g = at(event); return g && canvas.contains(g) ? Number(g.dataset.number) : -1; };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    press = { x: event.clientX, y: event.clientY, k: Math.max(numberAt(event), 0), dragging: false };
  });
  window.addEventListener("pointermove", (event) => {
    if (!press) { if (canvas.contains(event.target)) graph.hover(Math.max(numberAt(event), 0)); return; }
    const dx = event.clientX - press.x, dy = event.clientY - press.y;
    if (!press.dragging && Math.hypot(dx, dy) < PULLED) return;
    if (press.k) { if (!press.dragging) lifted(); over(event); } else {
      view.x -= dx / view.scale;
      view.y -= dy / view.scale;
      view.moved = true;
      Object.assign(press, { x: event.clientX, y: event.clientY });
      apply();
    }
    press.dragging = true;
  });
  canvas.addEventListener("pointerleave", () => graph.hover(0));
  window.addEventListener("pointerup", (event) => {
    if (!press) return;
    const { k, dragging } = press;
    if (dragging && k) {
      const to = numberAt(event);
      if (to >= 0 && to !== k) graph.drop(host.graph, k, to, event.shiftKey);
    }
    canvas.dragged = Boolean(dragging); // the click that ends a drag selects nothing
    released();
  });
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && press?.dragging) { event.stopImmediatePropagation(); released(); }
    if (event.key === "Shift" && press?.dragging && press.k) hint(press.over ?? -1, true);
  }, true);

  function lifted() {
    graph.hover(0);
    press.offered = graph.offered(host.graph, press.k);
    canvas.classList.add("dragging");
    host.graph.nodes.forEach((g, j) => g.classList.toggle("barred", !press.offered.has(j)));
    host.graph.nodes[press.k].classList.add("lifted");
  }
  function over(event) {
    const to = numberAt(event), g = host.graph.nodes[press.k];
    g.setAttribute("transform", `translate(${(event.clientX - press.x) / view.scale} ${(event.clientY - press.y) / view.scale})`);
    if (press.over !== to) {
      host.graph.nodes[press.over]?.classList.remove("target");
      host.graph.nodes[press.over = to]?.classList.add("target");
    }
    hint(to, event.shiftKey);
  }
  function hint(to, loop) {
    const { names, parent } = host.graph.data, name = (k) => (k > 0 ? names[k - 1] : "the ground");
    const own = name(press.k), other = name(to);
    let text = `Drop ${own} onto its new parent; Escape leaves it where it is.`;
    if (to >= 0 && to !== press.k) {
      if (to === parent[press.k - 1]) text = `${other} is the parent of ${own} already.`;
      else if (loop) text = `${other}: a second parent of ${own}, which closes a loop.`;
      else if (!press.offered.has(to)) text = `${other} hangs on ${own} and cannot carry it; with Shift: a loop.`;
      else text = `${other} becomes the parent of ${own}; with Shift: a second parent, a loop.`;
    }
    const box = host.querySelector(".drag-hint");
    box.hidden = false;
    box.textContent = text;
  }
  function released() {
    if (press?.k && press.dragging) {
      canvas.classList.remove("dragging");
      for (const g of host.graph.nodes) g.classList.remove("barred", "target", "lifted");
      host.graph.nodes[press.k]?.removeAttribute("transform");
      host.querySelector(".drag-hint").hidden = true;
    }
    press = null;
  }
  canvas.release = released;
};

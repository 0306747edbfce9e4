// Where things stand on the page: how two panels share a dock, what is enlarged, where the 3D view
// and the playback are. viser docks and moves the panels; the style reads the numbers set here.
pgraph.layout = (() => {
  const { make, choices, send } = pgraph;
  const root = document.documentElement.style;
  const pixels = (name, value) => root.setProperty(name, `${Math.round(value)}px`);
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];
  const arrangeSoon = () => pgraph.beforePicture("layout", arrange);

  const sizes = new ResizeObserver(arrangeSoon), known = new WeakSet();
  function follow(element) {
    if (!element || known.has(element)) return; // to observe again is to be told again
    known.add(element);
    sizes.observe(element);
  }

  function arrange() {
    const regions = all("[data-dock-region]");
    regions.forEach(follow);
    regions.forEach(share);
    for (const strip of all("[data-dock-strip]")) offerRoom(strip);
    for (const rail of all("[data-dock-minimize-all]")) rail.setAttribute("aria-label", rail.getAttribute("aria-expanded") === "true" ? "Minimize panels" : "Expand panels");
    foot();
  }

  // -- two panels in a dock ----------------------------------------------------------------------
  const SHARE = { left: 0.5, right: 0.55 }; // of the dock, at most, for the upper one
  const NEEDED = "button.simulate, table.bodies tr:nth-child(-n+2)"; // in sight, whatever the share
  const LEAST = 50, LOWER = 120, STEP = 16; // [px]: of a panel; of a lower one that nobody shrank; of a key
  const CALM = 800; // [ms] without need of its height before the upper one gives it back
  const NAMES = { left: "height of the table", right: "height of the model and the run" };
  const heights = {}, grown = {}; // by dock

  function share(region) {
    const edge = region.dataset.dockRegion, column = region.querySelector("[data-dock-scroll]:has(> [data-dock-divider])");
    const [upper, divider, , more] = column?.children ?? [];
    if (!divider || more) { root.removeProperty(`--upper-${edge}`); delete heights[edge]; return; } // as viser shares among more
    follow(column);
    const content = upper.querySelector(".mantine-ScrollArea-content");
    follow(content);
    const own = choices.get().heights?.[edge], most = column.clientHeight;
    let height = own === undefined ? wanted(upper, content, most, SHARE[edge]) : Math.min(own, most - LEAST);
    if (own === undefined && height < heights[edge]) {
      const rest = CALM - (performance.now() - (grown[edge] ??= performance.now()));
      if (rest > 0) { setTimeout(arrangeSoon, rest + 20); height = Math.min(heights[edge], most - LEAST); } else delete grown[edge];
    } else delete grown[edge];
    heights[edge] = Math.round(height);
    pixels(`--upper-${edge}`, height);
    const told = { role: "separator", tabindex: 0, "aria-orientation": "horizontal", "aria-label": NAMES[edge] ?? "height of the upper panel",
      title: "Drag or use the arrow keys; double click: as high as its content", "aria-valuenow": heights[edge], "aria-valuemin": LEAST, "aria-valuemax": Math.max(most - LEAST, LEAST) };
    for (const [name, value] of Object.entries(told)) if (divider.getAttribute(name) !== String(value)) divider.setAttribute(name, value);
  }
  function wanted(upper, content, most, part) {
    const frame = content?.closest(".mantine-ScrollArea-viewport");
    if (!frame) return most / 2;
    const head = upper.offsetHeight - frame.clientHeight, top = content.getBoundingClientRect().top;
    const needed = all(NEEDED, content).map((one) => one.getBoundingClientRect().bottom - top + head + 8);
    return Math.min(Math.max(Math.min(content.offsetHeight + head, part * most), ...needed), Math.max(most - LOWER, LEAST));
  }
  function set(edge, height) {
    const { [edge]: _, ...others } = choices.get().heights ?? {};
    choices.set({ heights: height === null ? others : { ...others, [edge]: Math.max(Math.round(height), LEAST) } });
    delete heights[edge];
    arrange();
  }
  const divided = (event) => {
    const divider = event.target.closest?.('[data-dock-divider="column"][role="separator"]');
    return divider && { divider, edge: divider.closest("[data-dock-region]").dataset.dockRegion };
  };
  window.addEventListener("pointerdown", (event) => {
    const found = event.button === 0 && divided(event);
    if (!found) return;
    event.stopPropagation(); // viser's own drag shares by weight
    const { divider, edge } = found, from = event.clientY, before = heights[edge], column = divider.parentElement;
    const move = ({ clientY }) => { if (clientY !== from) set(edge, Math.min(before + clientY - from, column.clientHeight - LEAST)); };
    const end = () => { window.removeEventListener("pointermove", move); column.removeAttribute("data-dock-resizing"); };
    column.setAttribute("data-dock-resizing", "");
    window.addEventListener("pointermove", move);
    for (const over of ["pointerup", "pointercancel", "blur"]) window.addEventListener(over, end, { once: true });
  }, true);
  window.addEventListener("dblclick", (event) => { const found = divided(event); if (found) set(found.edge, null); }, true);
  window.addEventListener("keydown", (event) => {
    const found = divided(event), by = { ArrowUp: -STEP, ArrowDown: STEP, Enter: 0 }[event.key];
    if (!found || by === undefined) return;
    event.preventDefault();
    set(found.edge, by ? heights[found.edge] + by : null);
  }, true);

  // -- a panel enlarged: from the left edge to the right dock, the playback over it ------------------
  const READ = new Set(["Digraph", "Constraints", "Scenario", "Operators", "Plots", "Report"]);
  const front = (strip) => strip.querySelector('[role="tab"][aria-selected="true"]')?.title ?? "";
  function offerRoom(strip) {
    if (!all('[role="tab"]', strip).some((tab) => READ.has(tab.title))) return;
    const group = strip.closest("[data-dock-group]");
    let toggle = strip.querySelector("button.pgraph-enlarge");
    if (!toggle) {
      toggle = make("button", { className: "pgraph-enlarge", onclick: () => enlarge(group, !("large" in group.dataset)) });
      toggle.addEventListener("pointerdown", (event) => event.stopPropagation()); // the strip is dragged by it
      strip.append(toggle);
      new MutationObserver(() => name(strip, toggle)).observe(strip, { subtree: true, attributeFilter: ["aria-selected"] });
    }
    name(strip, toggle);
  }
  function name(strip, toggle) {
    const large = "large" in strip.closest("[data-dock-group]").dataset, what = front(strip).toLowerCase();
    toggle.textContent = large ? "×" : "⤢";
    toggle.title = large ? "Back into its place (Esc)" : "Larger, beside the right dock";
    toggle.setAttribute("aria-label", `${large ? "close large" : "enlarge"} ${what}`);
    toggle.setAttribute("aria-pressed", large);
  }
  function enlarge(group, on) {
    for (const other of all("[data-dock-group][data-large]")) delete other.dataset.large;
    if (on) group.dataset.large = "";
    arrange();
  }
  // Whether there was anything to make small again.
  function smaller() {
    const group = document.querySelector("[data-dock-group][data-large]");
    if (group) enlarge(group, false);
    return Boolean(group);
  }

  // -- the 3D view and the playback -----------------------------------------------------------
  const playback = () => document.querySelector('[data-floating-window]:has([data-view="playback"])');
  const sheet = () => document.querySelector(".mantine-Paper-root:not([data-dock-leaf]):not([data-floating-window]):has(.pgraph)");
  // What stands at the bottom of the view, to put notices above it. [px]
  function foot() {
    const under = playback() ?? sheet();
    follow(under);
    const top = under?.getBoundingClientRect().top ?? innerHeight;
    pixels("--foot", top > innerHeight / 3 ? innerHeight - top : 0);
  }
  // The playback stays in the middle until it is moved; a double click on its handle puts it back.
  window.addEventListener("pointermove", (event) => {
    const grip = event.buttons === 1 && event.target.closest?.("[data-dock-griphandle]"), bar = grip && grip.closest("[data-floating-window]");
    if (bar && Math.abs(event.movementX) + Math.abs(event.movementY) > 0) bar.dataset.moved = "";
  }, true);
  window.addEventListener("dblclick", (event) => {
    const bar = event.target.closest?.("[data-dock-griphandle]")?.closest("[data-floating-window]");
    if (bar) { delete bar.dataset.moved; arrange(); }
  }, true);

  // The shape of the 3D view, once its size has settled: the camera is set for it. To observe is
  // to be told at once, so a reconnected page says it again, of the canvas that it has by then.
  let watched = null;
  function watch() {
    const canvas = document.querySelector("canvas:not(.pgraph *)");
    if (!canvas) { setTimeout(watch, 100); return; }
    watched?.disconnect();
    let settling = null;
    pgraph.tellView = () => {
      const aspect = canvas.clientWidth / canvas.clientHeight;
      if (!(aspect > 0)) return; // nothing of it is seen
      send("Viewport", { aspect: Math.min(Math.max(aspect, 0.06), 19), window: innerWidth, covered: covered(canvas), turned: pgraph.camera.turned() });
    };
    const tell = () => {
      if (canvas.isConnected) pgraph.tellView();
      else watch(); // viser made another one for a smaller window
    };
    watched = new ResizeObserver(() => {
      const { left, width } = canvas.getBoundingClientRect();
      pixels("--view-left", left);
      pixels("--view-width", width);
      arrangeSoon();
      clearTimeout(settling);
      settling = setTimeout(tell, 250);
    });
    watched.observe(canvas);
    if (sheet()) watched.observe(sheet());
    arrangeSoon();
  }
  // The share of the 3D view's height that panels take from its bottom: the middle one of three places.
  function covered(canvas) {
    const { left, width, bottom, height } = canvas.getBoundingClientRect();
    const share = (x) => {
      let y = bottom - 2;
      while (y > bottom - height && !document.elementFromPoint(x, y)?.matches("canvas, :has(canvas)")) y -= 4;
      return Math.round(50 * (bottom - 2 - y) / height) / 50;
    };
    return [0.2, 0.5, 0.8].map((at) => share(left + at * width)).sort((a, b) => a - b)[1];
  }
  watch();
  window.addEventListener("resize", arrangeSoon);

  return { arrange: arrangeSoon, watch, smaller };
})();

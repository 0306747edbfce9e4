// The frame of the page: a bar, the model at the left, the 3D view, results below it, the selection
// at the right, and time along the bottom. viser draws in the middle; our hosts stand in the slots.
pgraph.frame = (() => {
  const { make, icon, choices } = pgraph;
  const root = document.documentElement;
  const GAP = 8; // between the model and what lies over the view [px]
  const slots = {},
    tabs = {}; // by slot; by the name of a tab: {slot, label, pane, actions, count}
  const MOVES = {
    left: [240, 0.4, (event) => event.clientX],
    right: [220, 0.35, (event) => innerWidth - event.clientX],
    drawer: [140, 0.6, (event) => time().top - event.clientY],
  };
  const time = () => slots.time.parentElement.getBoundingClientRect();

  // `hosts` are [view, slot, tab], in their order. Returns the host of each view.
  function build(hosts) {
    const part = (name, tag = "div", ...children) =>
      (slots[name] = make(tag, { className: `pgraph-slot ${name}` }, ...children));
    const frame = make(
      "div",
      { className: "pgraph pgraph-frame" },
      part("top", "header"),
      part("left", "aside", strip("left"), edge("left")),
      part("view", "main"),
      part("drawer", "section", strip("drawer"), edge("drawer")),
      part("right", "aside", edge("right")),
      make("footer", { className: "pgraph-foot" }, part("run"), part("time"), part("trust")),
    );
    part("display");
    const display = make(
      "button",
      { className: "bare", title: "What is drawn in 3D" },
      icon("eye"),
      make("span", { textContent: "Display" }),
    );
    slots.view.append(
      make(
        "div",
        { className: "pgraph-tools", role: "toolbar", "aria-label": "view" },
        pgraph.opens(display, slots.display),
      ),
    );
    const made = hosts.map(([view, slot, tab]) => {
      const host = make("div", { className: "pgraph", "data-view": view });
      (tab ? tabOf(slot, tab).pane : slots[slot]).append(host);
      return [view, host];
    });
    slots.left.setAttribute("aria-label", "model");
    slots.right.setAttribute("aria-label", "selection");
    slots.drawer.setAttribute("aria-label", "results");
    sizes();
    document.body.append(frame);
    for (const slot of ["left", "drawer"])
      show(Object.values(tabs).find((tab) => tab.slot === slot));
    watch();
    return made;
  }

  // -- tabs ---------------------------------------------------------------------------------------
  function strip(slot) {
    const list = make("div", {
      className: "tabs",
      role: "tablist",
      "aria-label": slot === "left" ? "model" : "results",
      onkeydown: keyed,
    });
    const box = make("div", { className: "tab-strip" }, list, make("div", { className: "acts" }));
    if (slot === "drawer") {
      const large = iconButton("large", "Larger", () => {
        root.dataset.drawer = root.dataset.drawer === "large" ? "open" : "large";
      });
      box.append(
        large,
        iconButton("close", "Close the results", () => drawer(false)),
      );
    }
    return box;
  }
  const iconButton = (name, label, onclick) =>
    make(
      "button",
      { className: `bare ${name}`, title: label, "aria-label": label, onclick },
      icon(name),
    );

  function tabOf(slot, name) {
    if (tabs[name]) return tabs[name];
    const count = make("span", { className: "n" });
    const label = make(
      "button",
      {
        role: "tab",
        title: name,
        tabIndex: -1,
        "aria-selected": "false",
        onclick: () => show(tabs[name]),
      },
      name,
      count,
    );
    const pane = make("div", {
      className: "pane",
      role: "tabpanel",
      "aria-label": name,
      "data-tab": name,
      hidden: true,
    });
    const actions = make("span", { hidden: true });
    slots[slot].querySelector(".tabs").append(label);
    slots[slot].querySelector(".acts").append(actions);
    slots[slot].append(pane);
    return (tabs[name] = { slot, label, pane, actions, count });
  }
  function show(tab) {
    if (!tab) return;
    for (const other of Object.values(tabs)) {
      if (other.slot !== tab.slot) continue;
      const on = other === tab;
      other.label.setAttribute("aria-selected", on);
      other.label.tabIndex = on ? 0 : -1;
      other.pane.hidden = other.actions.hidden = !on;
      if (on) root.dataset[`${tab.slot}Tab`] = tab.label.title;
    }
  }
  function keyed(event) {
    const all = [...event.currentTarget.children],
      at = all.indexOf(document.activeElement),
      n = all.length;
    const to = { ArrowRight: (at + 1) % n, ArrowLeft: (at + n - 1) % n, Home: 0, End: n - 1 }[
      event.key
    ];
    if (to === undefined) return;
    event.preventDefault();
    all[to].focus();
    all[to].click();
  }
  // The tab of that name to the front, in an open slot.
  function front(name) {
    const tab = tabs[name];
    if (!tab) return;
    if (tab.slot === "drawer") drawer(true);
    else toggle("left", true);
    show(tab);
  }
  const isFront = (name) =>
    tabs[name]?.label.getAttribute("aria-selected") === "true" &&
    (tabs[name].slot !== "drawer" || Boolean(root.dataset.drawer));

  // -- what is open ---------------------------------------------------------------------------------
  function drawer(on) {
    if (on) root.dataset.drawer ||= "open";
    else delete root.dataset.drawer;
    if (on && narrow()) sheets();
  }
  function sheets() {
    for (const slot of ["left", "right"]) delete root.dataset[`${slot}Sheet`];
  }
  // A side panel is there, or gives its room to the view; in a narrow window it lies over the view.
  function toggle(
    slot,
    on = narrow() ? !(`${slot}Sheet` in root.dataset) : root.dataset[slot] === "closed",
  ) {
    if (narrow()) {
      sheets();
      if (on) {
        drawer(false);
        root.dataset[`${slot}Sheet`] = "";
      }
    } else if (on) delete root.dataset[slot];
    else root.dataset[slot] = "closed";
  }
  const narrow = () => innerWidth <= 760;
  // Whether there was anything to make small again.
  function smaller() {
    const large = root.dataset.drawer === "large",
      sheet = ["leftSheet", "rightSheet"].find((name) => name in root.dataset);
    if (large) root.dataset.drawer = "open";
    else if (sheet) delete root.dataset[sheet];
    return large || Boolean(sheet);
  }
  window.addEventListener(
    "keydown",
    (event) => {
      const slot = { b: "left", i: "right" }[event.key.toLowerCase()];
      if (!slot || !(event.ctrlKey || event.metaKey) || event.shiftKey || event.altKey) return;
      event.preventDefault();
      toggle(slot);
    },
    true,
  );

  // -- edges that are dragged -----------------------------------------------------------------------
  function edge(slot) {
    const grip = make("div", {
      className: "resizer",
      title: "Drag to resize, double-click to reset",
      ondblclick: () => resize(slot, null),
    });
    grip.onpointerdown = (event) => grip.setPointerCapture(event.pointerId);
    grip.onpointermove = (event) => {
      if (grip.hasPointerCapture(event.pointerId)) resize(slot, MOVES[slot][2](event));
    };
    return grip;
  }
  function resize(slot, size) {
    const [least, share] = MOVES[slot],
      most = share * (slot === "drawer" ? innerHeight : innerWidth),
      { [slot]: _, ...others } = choices.get().sizes ?? {};
    choices.set({
      sizes:
        size === null
          ? others
          : { ...others, [slot]: Math.round(Math.min(Math.max(size, least), most)) },
    });
    sizes();
  }
  function sizes() {
    const own = choices.get().sizes ?? {};
    for (const slot of Object.keys(MOVES)) {
      if (own[slot]) root.style.setProperty(`--own-${slot}`, `${own[slot]}px`);
      else root.style.removeProperty(`--own-${slot}`);
    }
  }

  // -- the shape of the 3D view, once its size has settled: the camera is set for it -----------------
  let watched = null;
  function watch() {
    const canvas = document.querySelector("canvas:not(.pgraph *)");
    if (!canvas) {
      setTimeout(watch, 100);
      return;
    }
    watched?.disconnect();
    let settling = null;
    pgraph.tellView = () => {
      const { clientWidth, clientHeight } = canvas,
        aspect = clientWidth / clientHeight,
        view = canvas.getBoundingClientRect(),
        bars = [".pgraph-views", ".pgraph-tools"].map((bar) => document.querySelector(bar)),
        [axes, tools] = bars.map((bar) => bar?.getClientRects()[0]), // none if it is hidden
        share = (covered, whole) => Math.min(Math.max(1 - (2 * covered) / whole, 0.5), 1),
        right = axes ? share(view.right - axes.left + GAP, clientWidth) : 1,
        top = tools ? share(tools.bottom - view.top + GAP, clientHeight) : 1;
      if (aspect > 0)
        pgraph.send("Viewport", {
          aspect: Math.min(Math.max(aspect, 0.06), 19),
          free: [1, right, 1, top],
          turned: pgraph.camera.turned(),
        });
    };
    watched = new ResizeObserver(() => {
      clearTimeout(settling);
      settling = setTimeout(() => {
        if (canvas.isConnected) pgraph.tellView();
        else watch();
      }, 250); // viser may have made another one
    });
    watched.observe(canvas);
  }

  return {
    build,
    front,
    isFront,
    drawer,
    toggle,
    smaller,
    watch,
    slot: (name) => slots[name],
    count: (name, n) => {
      if (tabs[name]) tabs[name].count.textContent = n || "";
    },
    actions: (name, ...made) => tabs[name]?.actions.append(...made),
  };
})();
pgraph.front = pgraph.frame.front;
pgraph.on("opened", () => {
  if (document.documentElement.dataset.drawer === "large") pgraph.frame.smaller();
}); // another model is seen

// The page's half of the bridge: topics come in through `pgraphInbox`, events go out through a
// hidden viser text. `window.__viserMutable` is viser's; nothing else here knows viser.
if (window.pgraph) return; // a reconnected page has it already
window.pgraph = (() => {
  const views = {};     // view name -> {build(host), topic: draw(host, data), ...}
  const listeners = {}; // topic -> function(data), for what is drawn in no host
  const latest = {}; // topic -> data, to draw again when a host is mounted
  let uplink = null, serial = 0, waiting = [];

  function flush() {
    const viser = window.__viserMutable;
    if (!uplink || !viser?.sendMessage) { setTimeout(flush, 50); return; }
    for (const value of waiting) {
      viser.sendMessage({ type: "GuiUpdateMessage", uuid: uplink, updates: { value } });
    }
    waiting = [];
  }

  const pgraph = {
    latest,
    view(name, topics) { views[name] = topics; },
    on(topic, act) { listeners[topic] = act; },
    // An event for Python, by its class name; the blank makes equal events differ for viser.
    send(event, fields = {}) {
      waiting.push(JSON.stringify({ event, ...fields }) + " ".repeat(serial++ % 2));
      flush();
    },
    nextSerial: () => ++serial,
    hosts: (view) => document.querySelectorAll(`.pgraph[data-view="${view}"]`),
    draw(view, topic) {
      const draw = views[view][topic];
      if (!draw || !(topic in latest)) return;
      for (const host of pgraph.hosts(view)) if (host.dataset.ready) draw(host, latest[topic]);
    },
    mount() {
      for (const [view, topics] of Object.entries(views)) {
        for (const host of pgraph.hosts(view)) {
          if (host.dataset.ready) continue;
          host.dataset.ready = "1";
          topics.build?.(host);
          for (const topic of Object.keys(topics)) {
            if (topic !== "build" && topic in latest) topics[topic](host, latest[topic]);
          }
        }
      }
    },
    receive(topic, data) {
      if (topic === "uplink") { connected(data); return; }
      latest[topic] = data;
      listeners[topic]?.(data);
      for (const view of Object.keys(views)) pgraph.draw(view, topic);
    },
    drain() {
      for (const [topic, data] of (window.pgraphInbox ??= []).splice(0)) pgraph.receive(topic, data);
    },
    start(css) {
      document.getElementById("pgraph-style")?.remove();
      document.head.append(pgraph.make("style", { id: "pgraph-style", textContent: css }));
      pgraph.mount();
      pgraph.drain();
    },
    // An element with properties, attributes (a, in data-/aria- form), children.
    make(tag, props = {}, ...children) {
      const el = document.createElement(tag);
      for (const [key, value] of Object.entries(props)) {
        if (key.includes("-") || key === "role") el.setAttribute(key, value);
        else el[key] = value;
      }
      el.append(...children);
      return el;
    },
  };

  // A sentence in passing, for what has no cell any more.
  pgraph.toast = (text) => {
    const note = pgraph.make("div", { className: "pgraph pgraph-toast", role: "alert", textContent: text });
    document.body.append(note);
    setTimeout(() => note.remove(), 8000);
  };

  // A reconnected page is a new client to viser: it takes its selection and theme along.
  function connected(uuid) {
    const again = uplink !== null;
    uplink = uuid;
    if (!again) return;
    if (latest.selection) pgraph.send("Select", { body: latest.selection });
    if (latest.theme?.dark) pgraph.send("Theme", { dark: true });
  }

  function shortcut(event) {
    const typing = event.target.closest?.("input, select, textarea");
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
      if (typing?.matches("input") && typing.value !== typing.dataset.shown) return;
      event.preventDefault();
      event.stopPropagation();
      pgraph.send(event.shiftKey || key === "y" ? "Redo" : "Undo");
    } else if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    else if (event.key === "Escape") pgraph.send("Select", { body: null });
    else if (event.key === " " && !event.target.closest?.("button")) {
      event.preventDefault();
      pgraph.send(latest.playback?.playing ? "Pause" : "Play");
    }
  }
  window.addEventListener("keydown", shortcut, true);
  return pgraph;
})();
const pgraph = window.pgraph;

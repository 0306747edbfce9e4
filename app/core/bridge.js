// The page's half of the bridge: topics come in through `pgraphInbox`, events go out through a
// hidden viser text. `window.__viserMutable` is viser's; nothing else here knows viser.
if (window.pgraph) return; // a reconnected page has it already
window.pgraph = (() => {
  const views = {}; // view name -> {build(host), topic: draw(host, data), ...}
  const listeners = {}; // topic -> functions of its data, for what is drawn in no host
  const hosts = new Map(); // view name -> the element that it draws in
  const latest = {}; // topic -> data, to draw again when a host is mounted
  const ME = crypto.getRandomValues(new Uint32Array(4)).join("-"); // this page, as long as it is open
  let uplink = null,
    serial = 0,
    began = null,
    waiting = [],
    resuming = null; // the serial of our Hello while we are coming back
  const late = new Set(); // topics that came meanwhile
  let sent = 0, // the last serial of an event, and of an answer: events are begun in their order
    answered = 0;
  const outdated = new Map(); // hidden view -> [the topic that it waits for, its children]

  // A fault in one view is told to the console; it takes nothing from the others.
  function safely(act) {
    try {
      act();
    } catch (fault) {
      setTimeout(() => {
        throw fault;
      });
    }
  }

  function hear(topic) {
    for (const act of listeners[topic] ?? []) safely(() => act(latest[topic]));
  }

  // A hidden view of a former model, or of rows that are gone, is off the page until its topic comes,
  // which it does once its tab is shown.
  function outdate(view, topic) {
    if (outdated.has(view)) return;
    const host = hosts.get(view);
    outdated.set(view, [topic, [...host.childNodes]]);
    host.replaceChildren();
    host.classList.add("outdated");
  }
  function update(topic) {
    for (const [view, [awaited, children]] of outdated) {
      if (awaited !== topic) continue;
      outdated.delete(view);
      const host = hosts.get(view);
      host.replaceChildren(...children);
      host.classList.remove("outdated");
    }
  }

  // What asks for the layout waits for the next picture, for which it is made once whatever changed.
  const beforePicture = new Map(); // what for -> act, the last one given
  function settle() {
    const acts = [...beforePicture.values()];
    beforePicture.clear();
    acts.forEach(safely);
  }

  function flush() {
    const viser = window.__viserMutable;
    if (!uplink || !viser?.sendMessage) {
      setTimeout(flush, 50);
      return;
    }
    for (const value of waiting) {
      viser.sendMessage({ type: "GuiUpdateMessage", uuid: uplink, updates: { value } });
    }
    waiting = [];
  }

  // The table stands: what covered the page until then goes.
  function unveil() {
    const loading = document.getElementById("pgraph-loading");
    loading?.classList.add("over");
    setTimeout(() => loading?.remove(), 300);
  }

  // A picture has been seen, or nobody looks: the next may come.
  function shown() {
    if (document.hidden) pgraph.send("Shown");
    else requestAnimationFrame(() => pgraph.send("Shown"));
  }

  // viser moves bodies in the frame that reads the messages, but redraws arrows and solids after
  // it, so that they would be one picture late. Read before the frame, all are drawn together.
  // What is for our script alone asks for no frame.
  function drawTogether() {
    const viser = window.__viserMutable;
    if (!viser) {
      setTimeout(drawTogether, 50);
      return;
    }
    let render = viser.requestRender; // viser sets it again when the 3D view is mounted again
    const read = () => {
      const came = viser.messageQueue,
        ours = came.length > 0 && came.every(({ type }) => type === "RunJavascriptMessage");
      if (came.length && viser.getRenderRequestState === "ready") viser.drainMessageQueue?.();
      if (ours && !came.length) return;
      asked = performance.now();
      drawChanges(viser.scene);
      render();
    };
    Object.defineProperty(viser, "requestRender", {
      get: () => read,
      set: (own) => {
        render = own;
      },
    });
  }

  // viser draws for a while after each message, and once a second at rest: with software GL every
  // frame takes a core for a fifth of a second or more. What nobody asks for is drawn rarely, except
  // what viser has put into the scene since the last picture, which may be long after the request
  // where pictures are slow: it makes solids in one task, and places their instances in a later one.
  const SETTLES = 1000,
    RARELY = 16e3; // [ms] after which textures are loaded; between pictures at rest
  const NEUTRAL = 7; // of three.js: hues as they are given (Khronos PBR Neutral)
  let asked = performance.now(),
    watchedScene = null;
  const ownMaterials = []; // acts before each frame, on materials that viser may have made again
  function contents(scene) {
    const found = [];
    scene.traverseVisible(({ id, geometry, material }) =>
      found.push(id, geometry?.id, material?.version),
    );
    return found.join();
  }
  function unplaced(scene) {
    let found = false; // instances that have not been given to the graphics processor
    scene.traverseVisible(({ matricesTexture, colorsTexture }) => {
      if (matricesTexture?._needsUpdate || colorsTexture?._needsUpdate) found = true;
    });
    return found;
  }
  function drawChanges(scene) {
    if (!scene || scene === watchedScene) return;
    watchedScene = scene;
    scene.onBeforeRender = (gl) => {
      delete scene.onBeforeRender;
      gl.toneMapping = NEUTRAL;
      gl.debug.checkShaderErrors = false; // to ask waits for the compiler
      const draw = gl.render,
        keep = (program) => {
          if (!program.pgraphKept) {
            program.pgraphKept = true;
            program.usedTimes++;
          }
        };
      let last = "",
        drawn = 0;
      gl.render = (what, camera) => {
        if (what !== scene || gl.getRenderTarget()) {
          draw.call(gl, what, camera);
          return;
        }
        for (const act of ownMaterials) safely(act);
        const now = performance.now(),
          holds = `${gl.domElement.width} ${gl.domElement.height} ${contents(scene)}`;
        const due = now - asked <= SETTLES || now - drawn >= RARELY;
        if (!due && holds === last && !unplaced(scene)) return;
        [drawn, last] = [now, holds];
        draw.call(gl, what, camera);
        gl.info.programs.forEach(keep); // a scene that is made again does not compile its shaders again
      };
    };
  }

  const pgraph = {
    latest,
    selecting: false, // another selection was asked for, and its form is not yet here
    view(name, topics) {
      views[name] = topics;
    },
    on(topic, act) {
      (listeners[topic] ??= []).push(act);
    },
    // An event for Python, by its class name; the blank makes equal events differ for viser.
    send(event, fields = {}) {
      if (/^(Select|ToggleBody)/.test(event)) pgraph.selecting = true;
      if (fields.serial) sent = fields.serial;
      waiting.push(
        JSON.stringify({
          event,
          seen: latest.version ?? null,
          ...(began === null ? {} : { typed: began }),
          ...fields,
        }) + " ".repeat(serial++ % 2),
      );
      flush();
    },
    nextSerial: () => ++serial,
    // What `act` sends was begun when the page showed that version of the model.
    since(version, act) {
      began = version ?? null;
      try {
        act();
      } finally {
        began = null;
      }
    },
    beforePicture(what, act) {
      if (!beforePicture.size) requestAnimationFrame(settle);
      beforePicture.set(what, act);
    },
    host: (view) => hosts.get(view),
    draw(view, topic) {
      const draw = views[view][topic],
        host = hosts.get(view);
      if (draw && host && topic in latest && !outdated.has(view))
        safely(() => draw(host, latest[topic]));
    },
    receive(topic, data) {
      if (topic === "uplink") {
        connected(data);
        return;
      }
      if (topic === "outdated") {
        outdate(...data);
        return;
      }
      if (topic === "time") shown();
      if (data?.serial) answered = Math.max(answered, data.serial);
      if (topic === "reply" && data.serial === resuming) {
        resumed();
        return;
      }
      latest[topic] = data;
      update(topic);
      if (topic === "playback") latest.time = data.moment;
      remember(topic, data);
      if (resuming !== null && topic !== "reply") {
        late.add(topic);
        return;
      }
      hear(topic);
      for (const view of Object.keys(views)) pgraph.draw(view, topic);
      if (topic === "table") unveil();
    },
    // A tab to the front, about a body: its view hears it as `connectionsFor`.
    show(tab, body) {
      pgraph.front(tab);
      pgraph.receive(`${tab.toLowerCase()}For`, body);
    },
    drain() {
      for (const [topic, data] of (window.pgraphInbox ??= []).splice(0))
        pgraph.receive(topic, data);
    },
    start(css, places) {
      document.head.append(pgraph.make("style", { id: "pgraph-style", textContent: css }));
      for (const [view, host] of pgraph.frame.build(places)) hosts.set(view, host);
      for (const [view, host] of hosts) safely(() => views[view]?.build?.(host));
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

  // What the page does with viser's camera. Our axes differ from three.js's by the root's rotation.
  pgraph.viser = {
    controls: () => window.__viserMutable?.cameraControl,
    // The materials of a node of the scene, and of its children, before each frame.
    materials(name, change) {
      ownMaterials.push(() =>
        window.__viserMutable?.nodeRefFromName[name]?.traverse(({ material }) => {
          for (const one of [material ?? []].flat()) change(one);
        }),
      );
    },
    frame(act) {
      ownMaterials.push(act);
    }, // before each frame
    turned([x, y, z]) {
      const [w, a, b, c] = window.__viserSceneTree?.getState()[""]?.wxyz ?? [1, 0, 0, 0];
      const [u, v, t] = [2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)];
      return [x + w * u + b * t - c * v, y + w * v + c * u - a * t, z + w * t + a * v - b * u];
    },
    // The camera and what it looks at, moved by as much [m].
    shift(way) {
      const controls = pgraph.viser.controls(),
        [x, y, z] = pgraph.viser.turned(way);
      const { position, target } = {
        position: controls.camera.position.clone(),
        target: controls.camera.position.clone(),
      };
      controls.getPosition(position, true);
      controls.getTarget(target, true);
      controls.setLookAt(
        position.x + x,
        position.y + y,
        position.z + z,
        target.x + x,
        target.y + y,
        target.z + z,
        false,
      );
      controls.update(0); // in the picture in which the bodies have moved, with what is behind all of them
      const { scene, backgroundMaterial } = window.__viserMutable;
      scene.traverse((one) => {
        if (one.material && one.material === backgroundMaterial)
          one.position.set(one.position.x + x, one.position.y + y, one.position.z + z);
      });
    },
  };

  // To draw on a canvas that the graphics process has no part in: where it draws the 3D view without
  // a card, each picture of another canvas waits for it, for seconds, and so do clicks.
  pgraph.pen = (canvas) => canvas.getContext("2d", { willReadFrequently: true });

  // `act(true)` when a host comes into view, `act(false)` when it leaves it, as tabs change.
  const inView = new Map(); // host -> act, told again after a reconnection
  pgraph.whileVisible = (host, act) => {
    new IntersectionObserver((entries) => {
      const now = entries.at(-1).isIntersecting;
      if (now === inView.has(host)) return;
      if (now) inView.set(host, act);
      else inView.delete(host);
      act(now);
    }).observe(host);
  };

  pgraph.inView = (host) => inView.has(host);

  // The server knows whether this page has a view in sight: what others show costs an edit nothing.
  pgraph.inSight = (host, view, act = () => {}) =>
    pgraph.whileVisible(host, (on) => {
      act(on);
      pgraph.send("Sees", { view, on });
    });

  // What a person chose for this page is there again after a reload; what the system prefers holds at first.
  const CHOICES = "pgraph choices";
  pgraph.choices = {
    get() {
      try {
        return JSON.parse(localStorage.getItem(CHOICES)) ?? {};
      } catch {
        return {};
      }
    },
    set(changed) {
      try {
        localStorage.setItem(CHOICES, JSON.stringify({ ...pgraph.choices.get(), ...changed }));
      } catch {
        /* a private window keeps nothing */
      }
    },
  };
  function chosen() {
    const kept = pgraph.choices.get();
    const dark = kept.dark ?? matchMedia("(prefers-color-scheme: dark)").matches;
    return {
      dark,
      display: kept.display ?? ["deg", "m", "quaternion", "com"],
      body: kept.body ?? null,
      plots: kept.plots ?? [],
    };
  }

  function remember(topic, data) {
    const { get, set } = pgraph.choices;
    if (topic === "selection") set({ body: data });
    else if (topic === "plots") set({ plots: data.charts.map(({ kind, of }) => [kind, of]) });
    else if (topic === "properties") {
      const { angle, length, turn, about } = data.display;
      set({ display: [angle, length, turn, about] });
    } else if (topic === "theme" && data.dark !== chosen().dark) set({ dark: data.dark });
  }

  function redraw(view) {
    for (const topic of Object.keys(views[view])) if (topic !== "build") pgraph.draw(view, topic);
  }

  // A reconnected page is a new client to viser. It says who it was, and draws nothing until it is
  // that again: a form of something else would take the place of what is half typed.
  function connected(uuid) {
    const again = uplink !== null,
      kept = chosen();
    const { angle, length, turn, about } = latest.properties?.display ?? {};
    uplink = uuid;
    answered = sent;
    const hello = ++serial;
    if (again) resuming = hello;
    const display = again && angle ? [angle, length, turn, about] : kept.display;
    pgraph.send("Hello", {
      serial: hello,
      page: ME,
      body: latest.selection ?? (again ? null : kept.body),
      bodies: latest.selected ?? [],
      dark: again ? Boolean(latest.theme?.dark) : kept.dark,
      display,
      plots: again ? null : kept.plots,
    });
  }
  function resumed() {
    resuming = null;
    for (const topic of late) hear(topic);
    late.clear();
    for (const view of Object.keys(views)) redraw(view);
    pgraph.cells.again();
    for (const act of inView.values()) act(true);
    pgraph.frame.watch();
  }

  function shortcut(event) {
    const typing = event.target.closest?.("input, select, textarea");
    const key = event.key.toLowerCase();
    if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
      const halfTyped =
        typing?.dataset.shown !== undefined && typing.value !== typing.dataset.shown;
      if (halfTyped && !typing.classList.contains("waiting")) return; // the browser's own undo
      event.preventDefault();
      event.stopPropagation();
      pgraph.cells.clear();
      pgraph.send(event.shiftKey || key === "y" ? "Redo" : "Undo");
    } else if (event.ctrlKey || event.metaKey || event.altKey) return;
    else if (typing) {
      if (event.key === "Escape" && typing.value === typing.dataset.shown) typing.blur();
    } // nothing to take back
    else if (event.key === "Escape") {
      if (!pgraph.cells.clear() && !pgraph.overlaid() && !pgraph.frame.smaller())
        pgraph.send("Select", { body: null });
    } else if (event.key === " " && !event.target.closest?.("button, dialog")) {
      event.preventDefault();
      if (event.shiftKey) pgraph.simulate();
      else pgraph.play();
    }
  }
  drawTogether();
  window.addEventListener("keydown", shortcut, true);
  // The server drops what a closed page asked for and what it has not begun.
  window.addEventListener("beforeunload", (event) => {
    if (sent > answered) event.preventDefault();
  });
  return pgraph;
})();
const pgraph = window.pgraph;

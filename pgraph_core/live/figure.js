// The figure: what the reader sees and does. The engine computes, the view draws.
(() => {
  const MOST_BEHIND = 0.1; // [s] of motion in one picture: slower computers show slow motion
  const KEPT = 20000; // pictures
  const APART = 1 / 60; // [s] of motion between two of them
  const find = (selector) => document.querySelector(selector);
  let lacking = ""; // what this browser cannot do: stays in front of all that is told
  const say = (text, wrong = false) => {
    find("#said").textContent = lacking + text;
    find("#said").classList.toggle("wrong", wrong || !!lacking);
  };

  async function main() {
    const given = JSON.parse(find("#figure").textContent);
    share(given.link);
    const { Engine, unpacked, Problem } = pgraphEngine;
    const frames = await recorded(given, unpacked);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const theme = () =>
      dark.matches
        ? { ground: [0.2, 0.22, 0.26], line: [0.33, 0.36, 0.42] }
        : { ground: [0.91, 0.92, 0.94], line: [0.78, 0.8, 0.84] };

    let view = null,
      engine = null,
      world = null;
    try {
      view = new pgraphView.View(find("canvas"), given.scene, theme);
    } catch {
      find("canvas").hidden = true;
      lacking = "This browser has no WebGL 2, so the motion is not drawn. ";
    }
    let broken = "";
    const computes = given.engine.methods.length > 0; // else it is a recording on purpose
    try {
      engine = await Engine.made(given.engine);
      world = await engine.world();
    } catch (error) {
      broken = computes
        ? error instanceof Problem
          ? error.message
          : "The browser refused the kernels."
        : given.engine.refused;
      broken = `${broken} The recorded run is shown; it cannot be changed.`.trim();
      engine = null;
    }
    window.pgraph_live = {
      simulate: (options) =>
        engine ? engine.simulate(options) : Promise.reject(new Error(broken)),
      at: (clientX, clientY) =>
        view?.hit(view.pieces, view.ray({ clientX, clientY }))?.piece.body ?? null,
      open: given.engine.open.map(({ path, value, low, high, values, unit }) => ({
        path,
        value,
        low,
        high,
        values,
        unit,
      })),
    };

    // -- what is shown: recorded or computed pictures, at a time ----------------------------------

    const first = given.engine.t_start,
      last = given.engine.t_end,
      slider = find("#time");
    const usual = given.engine.runs[given.engine.methods[0]]?.usual; // steps
    let shown = frames,
      at = 0,
      playing = false,
      live = false,
      speed = 1,
      clock = 0,
      head = 0,
      grip = null,
      owed = 0;
    const values = Object.fromEntries(given.engine.open.map((one) => [one.path, one.value]));
    const changed = () =>
      Object.fromEntries(
        Object.entries(values).filter(
          ([path, x]) => x !== given.engine.open.find((one) => one.path === path).value,
        ),
      );

    function draw() {
      const frame = shown[at];
      const pieces = given.scene.pieces.map((piece) => bent(piece, values));
      const hold = grip && { from: grip.from, target: grip.target };
      view?.follow(frame.places);
      view?.draw(pieces, frame.places, frame.turns, hold);
      view && (view.pieces = pieces);
      plot(frame);
      slider.value = frame.t;
      find("#clock").textContent = `${frame.t.toFixed(2)} s`;
      slider.setAttribute("aria-valuetext", `${frame.t.toFixed(2)} seconds`);
    }

    // One number over time: the recorded run, and what was computed since.
    const picked = find("#plotted"),
      { columns } = given.scene;
    columns.forEach(({ name, unit }, i) =>
      picked.append(new Option(unit ? `${name} [${unit}]` : name, i)),
    );
    picked.addEventListener("change", () => draw());
    find("#plot").hidden = columns.length === 0;

    function plot(frame) {
      if (!columns.length || !find("#plot").open) return;
      const { of, index, unit } = columns[picked.value];
      const points = (list) => {
        const every = Math.ceil(list.length / 800);
        return list
          .filter((_, i) => i % every === 0 || i === list.length - 1)
          .map(({ t, [of]: x }) => [t, x[index]]);
      };
      const before = points(frames),
        since = live ? points(shown) : [],
        all = [...before, ...since].map(([, x]) => x);
      const low = Math.min(...all),
        high = Math.max(...all),
        span = high - low || 1;
      const x = (t) => ((600 * (t - first)) / (slider.max - first || 1)).toFixed(1);
      const path = (list) =>
        list
          .map(
            ([t, y], i) => `${i ? "L" : "M"}${x(t)} ${(95 - (90 * (y - low)) / span).toFixed(2)}`,
          )
          .join("");
      find("#recorded").setAttribute("d", path(before));
      find("#computed").setAttribute("d", path(since));
      find("#plot p span").hidden = !live;
      find("#cursor").setAttribute("d", `M${x(frame.t)} 0V100`);
      const text = (y) => `${Number(y.toPrecision(4))} ${unit}`;
      find("#low").textContent = text(low);
      find("#high").textContent = text(high);
      find("#now").textContent = text(frame[of][index]);
    }

    function picture() {
      const [places, turns] = world.poses(),
        { t, q, v } = world.shown;
      return { t, q: q.slice(), v: v.slice(), places: places.slice(), turns: turns.slice() };
    }

    // Compute from here on, or from the start: `again`.
    function goLive(again) {
      if (!engine) return false;
      const from = again ? null : shown[at];
      world.reset(engine.fields(given.engine.methods[0], changed()));
      if (from) {
        world.q.set(from.q);
        world.v.set(from.v);
        world.data.setFloat64(world.control("time"), from.t, true);
        world.begin();
      }
      live = true;
      shown = [picture()];
      at = 0;
      owed = 0;
      return true;
    }

    // Less than a step is left, where steps have a width.
    const ended = () => world.shown.t > last - (usual.step ? 0.999 * usual.step : 0);

    function advance(seconds) {
      owed = Math.min(owed + seconds, MOST_BEHIND);
      if (!grip) owed = Math.min(owed, last - world.shown.t + 1e-9);
      world.pull(grip && grip.spring);
      for (let before = NaN; world.shown.t !== before && owed > 0;) {
        before = world.shown.t;
        const part = Math.min(owed, Math.max(APART, usual.step || 0));
        owed -= part - world.go(part, usual, last - first, !!grip);
        if (world.shown.t !== before) shown.push(picture());
      }
      if (shown.length > KEPT) shown.splice(1, KEPT / 2);
      at = shown.length - 1;
      if (grip) grip.from = pointOf(grip, shown[at]);
      if (world.shown.t > slider.max) slider.max = world.shown.t;
    }

    function tick(now) {
      const gone = Math.min((now - clock) / 1000, 0.25) * speed;
      clock = now;
      if (!playing) return;
      guarded(() => {
        if (at < shown.length - 1) {
          head = Math.max(head, shown[at].t) + gone;
          while (at < shown.length - 1 && shown[at + 1].t <= head) at++;
        } else if (live && (grip || !ended())) advance(gone);
        else play(false);
        draw();
      });
      if (playing) requestAnimationFrame(tick);
    }

    function guarded(act) {
      try {
        act();
      } catch (error) {
        play(false);
        say(error.message, true);
      }
    }

    function play(on) {
      if (on && !playing && at === shown.length - 1 && !grip) {
        if (live && ended()) guarded(() => goLive(true));
        else if (!live) at = 0;
      }
      if (on && !playing) {
        head = shown[at].t;
        clock = performance.now();
        requestAnimationFrame(tick);
      }
      playing = on;
      find("#play").textContent = on ? "Pause" : "Play";
      find("#play").setAttribute("aria-pressed", String(on));
    }

    // -- what the reader changes -----------------------------------------------------------------

    const { open } = given.engine;
    for (const one of open) {
      const label = document.createElement("label"),
        range = document.createElement("input"),
        number = document.createElement("output");
      label.className = "open";
      label.append(one.label, number, range);
      Object.assign(range, {
        type: "range",
        min: one.low,
        max: one.high,
        step: "any",
        value: one.value,
        disabled: !engine,
      });
      range.setAttribute("aria-label", one.unit ? `${one.label} [${one.unit}]` : one.label);
      const show = () => {
        number.textContent = `${Number(values[one.path].toPrecision(4))} ${one.unit}`;
        range.value = values[one.path];
        range.setAttribute("aria-valuetext", number.textContent);
      };
      one.show = show;
      range.addEventListener("input", () => {
        const wanted = Math.min(one.high, Math.max(one.low, Number(range.value)));
        values[one.path] = one.values.reduce(
          (near, x) => (Math.abs(x - wanted) < Math.abs(near - wanted) ? x : near),
          one.values[0] ?? wanted,
        );
        show();
        guarded(() => {
          if (!goLive(true)) return;
          say(`Computed here, with the changed values, by ${given.engine.how}.`);
          play(true);
          draw();
        });
      });
      show();
      find("#open").append(label);
    }
    find("#open").hidden = open.length === 0;
    find("#reset").addEventListener("click", () => {
      for (const one of open) {
        values[one.path] = one.value;
        one.show();
      }
      guarded(() => {
        play(false);
        live = false;
        shown = frames;
        at = 0;
        slider.max = last;
        view?.fit();
        say("The recorded run.");
        draw();
      });
    });
    find("#play").addEventListener("click", () => play(!playing));
    find("#speed").addEventListener("change", (event) => {
      speed = Number(event.target.value);
    });
    slider.min = first;
    slider.max = last;
    slider.addEventListener("input", () => {
      play(false);
      const t = Number(slider.value);
      if (live)
        guarded(() => {
          // what lies ahead is computed
          for (let before = NaN; world.shown.t !== before && world.shown.t < t && !ended();) {
            before = world.shown.t;
            advance(MOST_BEHIND);
          }
        });
      at = shown.findLastIndex((frame) => frame.t <= t + 1e-9);
      at = Math.max(at, 0);
      draw();
    });

    // -- the mouse pulls ---------------------------------------------------------------------------

    function pointOf({ piece, local }, frame) {
      const b = 3 * piece.body,
        r = frame.turns.subarray(3 * b, 3 * b + 9);
      return [0, 1, 2].map(
        (i) =>
          frame.places[b + i] +
          r[3 * i] * local[0] +
          r[3 * i + 1] * local[1] +
          r[3 * i + 2] * local[2],
      );
    }

    if (view) {
      view.grab = (event) => {
        if (!engine) return false;
        const hit = view.hit(view.pieces, view.ray(event));
        if (!hit) return false;
        guarded(() => {
          if (!live || at < shown.length - 1 || world.t !== world.shown.t) goLive(false);
          const frame = shown[at],
            b = 3 * hit.piece.body,
            r = frame.turns.subarray(3 * b, 3 * b + 9);
          const away = [0, 1, 2].map((i) => hit.point[i] - frame.places[b + i]);
          const local = [0, 1, 2].map(
            (j) => r[j] * away[0] + r[3 + j] * away[1] + r[6 + j] * away[2],
          );
          const { row, offset, home } = given.scene.bodies[hit.piece.body],
            { mass } = given.scene;
          const point = [0, 1, 2].map(
            (i) =>
              offset[i] +
              home[3 * i] * local[0] +
              home[3 * i + 1] * local[1] +
              home[3 * i + 2] * local[2],
          );
          const spring = { row, point, target: hit.point, stiffness: 60 * mass, damping: 6 * mass };
          grip = { piece: hit.piece, local, from: hit.point, target: hit.point, spring };
          say(`Pulling on ${given.scene.bodies[hit.piece.body].name}.`);
          play(true);
        });
        return !!grip;
      };
      view.drag = (event) => {
        if (!grip) return;
        grip.target = view.facing(event, grip.from);
        grip.spring.target = grip.target;
      };
      view.letGo = () => {
        grip = null;
        if (live) guarded(() => world.pull(null));
        say(`Computed here by ${given.engine.how}.`);
      };
      const again = () => draw();
      new ResizeObserver(again).observe(find("canvas"));
      dark.addEventListener("change", again);
      window.addEventListener("beforeprint", again);
      for (const name of ["pointermove", "wheel", "pointerup"])
        find("canvas").addEventListener(name, () => {
          if (!playing) draw();
        });
    }

    // -- keys --------------------------------------------------------------------------------------

    document.addEventListener("keydown", (event) => {
      const keys = {
        " ": () => play(!playing),
        Home: () => {
          at = 0;
        },
        End: () => {
          at = shown.length - 1;
        },
        ArrowLeft: () => {
          at = Math.max(at - 1, 0);
        },
        ArrowRight: () => {
          at = Math.min(at + 1, shown.length - 1);
        },
        f: () => view?.fit(),
        "+": () => view?.zoom(0.85),
        "-": () => view?.zoom(1.18),
      };
      const own = {
        SELECT: Object.keys(keys),
        INPUT: ["Home", "End", "ArrowLeft", "ArrowRight"],
        BUTTON: [" "],
        SUMMARY: [" "],
      };
      const taken = own[event.target.tagName]?.includes(event.key);
      if (taken || event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
      draw();
    });

    find("#controls").hidden = false;
    find("#fit").hidden = !view;
    find("#fit").addEventListener("click", () => {
      view.fit();
      draw();
    });
    draw();
    const hint =
      engine && view ? "Drag a body to pull on it, the background to turn the view." : "";
    say(
      broken || (open.length ? `Move a slider to change the mechanism. ${hint}` : hint),
      !!broken && computes,
    );
    document.body.dataset.ready = engine ? "live" : "recorded";
  }

  // The recorded pictures: time, places and turns of all bodies; q and v where there is an engine.
  async function recorded(given, unpacked) {
    const { count, bodies, nq, nv } = given.recording;
    const data = (await unpacked(given.recording.data)).buffer;
    let from = 0;
    const take = (n, kind) => {
      const found = new kind(data, from, n);
      from += n * kind.BYTES_PER_ELEMENT;
      return found;
    };
    const t = take(count, Float64Array),
      q = take(count * nq, Float64Array),
      v = take(count * nv, Float64Array);
    const places = take(count * bodies * 3, Float32Array),
      turns = take(count * bodies * 9, Float32Array);
    return Array.from({ length: count }, (_, i) => ({
      t: t[i],
      q: q.subarray(i * nq, (i + 1) * nq),
      v: v.subarray(i * nv, (i + 1) * nv),
      places: places.subarray(i * bodies * 3, (i + 1) * bodies * 3),
      turns: turns.subarray(i * bodies * 9, (i + 1) * bodies * 9),
    }));
  }

  // A piece as it is drawn with these values of the open fields: numbers that follow them linearly.
  function bent(piece, values) {
    let found = piece;
    for (const [path, base, slope] of piece.follows || []) {
      const by = values[path] - base;
      const moved = (list, rates) => list.map((x, i) => x + by * rates[i]);
      found = {
        ...found,
        size: moved(found.size, slope.size).map((x) => Math.max(x, 1e-6)),
        position: moved(found.position, slope.position),
      };
    }
    return found;
  }

  // The model, which is in its link: as a file, and as the link.
  function share(link) {
    find("#share").hidden = !link;
    if (!link) return;
    find("#download").addEventListener("click", async () => {
      const letters = link.split("#m=")[1].replace(/-/g, "+").replace(/_/g, "/");
      const bytes = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
      const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
      const file = URL.createObjectURL(await new Response(stream).blob());
      const anchor = document.createElement("a");
      [anchor.href, anchor.download] = [
        file,
        `${document.title.replace(/[^\p{L}\p{N}_-]+/gu, "_")}.json`,
      ];
      anchor.click();
      setTimeout(() => URL.revokeObjectURL(file), 1000);
    });
    find("#link").addEventListener("click", async () => {
      const told = find("#copied");
      try {
        await navigator.clipboard.writeText(link);
        told.textContent = `Copied ${link.length} characters; start Pgraph, and open the link.`;
      } catch {
        const anchor = document.createElement("a"); // for the browser's own menu
        [anchor.href, anchor.textContent] = [link, "the link, to copy"];
        told.replaceChildren(anchor);
      }
    });
  }

  main().catch((error) => {
    window.pgraph_live = { simulate: () => Promise.reject(error), open: [] };
    say(
      `The figure cannot be shown: ${error.message}. The file may be damaged or cut short.`,
      true,
    );
  });
})();

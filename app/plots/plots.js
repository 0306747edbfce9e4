// Plots: quantities to choose from, charts that share their time axis, a cursor that follows playback,
// and measurements of what is in sight.
(() => {
  const { make, send } = pgraph;
  const SERIES = 8; // colours, which the style has as --s0 and so on
  const DASHES = [[], [6, 3], [2, 2]],
    KEPT = [
      [5, 3],
      [2, 2],
      [8, 2, 2, 2],
      [1, 3],
      [8, 4],
    ]; // [px]
  const NOISE = 2 ** 12 * Number.EPSILON; // of the largest value of a plot: rounding of thousands of operations
  const TOP = 6,
    BOTTOM = 28,
    UNITS = 18,
    AXIS = 44; // [px] also above curves of several units, and beside them for each further one
  // The sides beside the curves. A chart of the whole width has the time axis of the strip below.
  function sides(canvas) {
    const [box, strip] = [canvas, document.querySelector(".pgraph .scrub")].map((one) =>
      one.getBoundingClientRect(),
    );
    const [left, right] = [strip.left + 6 - box.left, box.right - strip.right + 6]; // at its ends the middle of the thumb
    return strip.width && Math.abs(left) < 100 && Math.abs(right) < 40
      ? [Math.max(left, 52), Math.max(right, 0)]
      : [52, 8];
  }
  const heightOf = (canvas) => canvas.clientHeight || 142;
  const BAND = 0.02; // of its way within which a curve has settled
  const LAST = 0.2; // of the time in sight: the part in which a settled curve rests; half a cosine varies by 0.1 of its way there
  const LOUD = 1e-3; // of the largest amplitude: smaller ones end a spectrum and count as no swing
  let zoom = null,
    charts = [],
    cursor = 0,
    measured = false,
    spectra = false,
    begun = false;

  function build(host) {
    const chooser = make(
      "div",
      { className: "signals" },
      make("div", { className: "chips of-body" }),
      make("div", { className: "chips of-scene" }),
      make("div", { className: "muted hint" }),
    );
    const add = make(
      "button",
      { className: "bare add-plot", title: "Quantities of the selected body and of the run" },
      pgraph.icon("add"),
      make("span", { textContent: "Add plot" }),
    );
    const measure = pgraph.pictureButton(
      "bare measure",
      "ruler",
      "Measure",
      "Minimum, maximum, mean, RMS, overshoot, settling time and frequency of what is in sight",
      () => {
        measured = !measured;
        measure.setAttribute("aria-pressed", measured);
        paintAll(host);
      },
    );
    const spectrum = pgraph.pictureButton(
      "bare spectrum",
      "spectrum",
      "Spectrum",
      "Amplitudes over the frequency, of what is in sight",
      () => {
        spectra = !spectra;
        spectrum.setAttribute("aria-pressed", spectra);
        paintAll(host);
      },
    );
    pgraph.frame.actions("Plots", measure, spectrum, pgraph.opens(add, chooser, { end: true }));
    host.pgraphChooser = chooser;
    host.replaceChildren(
      make("div", { className: "ready", role: "toolbar", "aria-label": "ready plots" }),
      make("p", { className: "muted none" }),
      make("div", { className: "charts" }),
    );
    new ResizeObserver(() => paintAll(host)).observe(host.querySelector(".charts"));
    pgraph.whileVisible(host, () => begin(host));
  }
  // The first look at a run shows something: how its joints move.
  function begin(host) {
    const { hint, ready } = pgraph.latest.signals ?? { hint: "no run" };
    if (begun || hint || !pgraph.inView(host) || !ready.length) return;
    begun = true;
    if (!charts.length) send("Replot", { off: [], on: ready[0][1] });
  }
  // A ready plot takes the place of another one, or stands beside it with Ctrl. Pressed again it goes.
  function press(event, signals) {
    const beside = event.ctrlKey || event.metaKey,
      every = pgraph.latest.signals.ready.flatMap(([, others]) => others);
    if (plotted(signals)) send("Replot", { off: signals, on: [] });
    else send("Replot", { off: beside ? [] : every, on: signals });
  }
  const plotted = (signals) => signals.every(([kind, of]) => shown(kind, of));

  const shown = (kind, of) => charts.some((c) => c.data.kind === kind && c.data.of === of);

  function choices(host, data) {
    const chip = ([kind, of, label]) =>
      make("button", {
        className: "chip-button",
        textContent: label,
        "data-kind": kind,
        "data-of": of,
        "aria-pressed": shown(kind, of),
        onclick: (event) =>
          send("Plot", {
            kind,
            of,
            on: event.currentTarget.getAttribute("aria-pressed") !== "true",
          }),
      });
    const heading = (text) => make("span", { className: "muted heading-text", textContent: text });
    const box = host.pgraphChooser;
    host.querySelector(".none").textContent = data.hint || "Nothing is plotted yet.";
    box
      .querySelector(".of-body")
      .replaceChildren(
        ...(data.body
          ? [heading(`${data.body}:`), ...data.of_body.map(chip)]
          : [heading("Select a body to plot its motion and forces.")]),
      );
    const scene = box.querySelector(".of-scene"),
      open = scene.querySelector("details")?.open ?? false;
    const idle = data.idle.length
      ? [
          make(
            "details",
            { open },
            make("summary", { textContent: data.idle_title }),
            ...data.idle.map(chip),
          ),
        ]
      : [];
    scene.replaceChildren(
      ...(data.of_scene.length ? [heading("Run:"), ...data.of_scene.map(chip), ...idle] : []),
    );
    const chips = data.ready.map(([label, signals]) =>
      Object.assign(
        make("button", {
          className: "chip-button",
          textContent: label,
          "aria-pressed": plotted(signals),
          title: "with Ctrl beside the others",
          onclick: (event) => press(event, signals),
        }),
        { signals },
      ),
    );
    host.querySelector(".ready").replaceChildren(...chips);
    box.querySelector(".hint").textContent = data.hint;
    box.querySelector(".hint").hidden = !data.hint;
    begin(host);
  }

  function draw(host, data) {
    const kept = new Map(charts.map((c) => [`${c.data.kind}/${c.data.of}`, c]));
    const fresh = charts.length && data.charts.find((d) => !kept.has(`${d.kind}/${d.of}`));
    charts = data.charts.map((d) => {
      const chart = kept.get(`${d.kind}/${d.of}`) ?? newChart(host, d);
      chart.data = d;
      Object.assign(chart.box.dataset, { kind: d.kind, of: d.of });
      chart.box.querySelector(".unit").textContent = d.unit ? `[${d.unit}]` : "";
      if (d.kind === "poses") strip(chart);
      chart.box.classList.toggle("many", d.components.length > 0 || d.curves.length > 4);
      chart.axes.replaceChildren(
        ...(d.components.length > 1 ? d.components : []).map((component) =>
          make("button", {
            className: "chip-button",
            textContent: component,
            "aria-label": `component ${component} of ${d.title}`,
            "aria-pressed": d.kind.endsWith(`.${component}`),
            onclick: () => send("PlotComponent", { kind: d.kind, of: d.of, component }),
          }),
        ),
      );
      return chart;
    });
    host.querySelector(".charts").replaceChildren(...charts.map((c) => c.box));
    host.querySelector(".none").hidden = charts.length > 0;
    pgraph.frame.count("Plots", charts.length);
    for (const chip of host.pgraphChooser.querySelectorAll(".chips .chip-button")) {
      chip.setAttribute("aria-pressed", shown(chip.dataset.kind, chip.dataset.of));
    }
    for (const chip of host.querySelectorAll(".ready .chip-button"))
      chip.setAttribute("aria-pressed", plotted(chip.signals));
    paintAll(host);
    if (fresh) charts.find((c) => c.data === fresh).box.scrollIntoView({ block: "nearest" }); // what was asked for is in sight
  }

  function newChart(host, data) {
    const canvas = make("canvas", { className: "chart", role: "img", "aria-label": data.title });
    const legend = make("span", { className: "legend" }),
      axes = make("span", { className: "axes" });
    const chart = {
      data,
      canvas,
      legend,
      axes,
      strip: make("div", { className: "strip" }),
      hover: null,
    };
    chart.box = make(
      "figure",
      { className: "plot" },
      make(
        "figcaption",
        {},
        make("strong", { textContent: data.title }),
        make("span", { className: "muted unit" }),
        axes,
        legend,
        pgraph.pictureButton(
          "bare picture",
          "export",
          `save a picture of ${data.title}`,
          `Save ${data.title} as a picture`,
          () => save(chart),
        ),
        pgraph.pictureButton(
          "bare remove",
          "close",
          `take away ${data.title}`,
          `Remove ${data.title}`,
          () => send("Plot", { kind: data.kind, of: data.of, on: false }),
        ),
      ),
      chart.strip,
      canvas,
      (chart.table = make("table", { className: "measures", hidden: true })),
    );
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = event.offsetX;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      chart.hover = event.offsetX;
      chart.band = from === null ? null : [from, event.offsetX];
      paint(chart);
    });
    canvas.addEventListener("pointerleave", () => {
      chart.hover = null;
      paint(chart);
    });
    canvas.addEventListener("pointerup", (event) => {
      const span = [from, event.offsetX].sort((a, b) => a - b).map((x) => timeAt(chart, x));
      const dragged = Math.abs(event.offsetX - from) > 5;
      from = chart.band = null;
      if (spectra) return;
      if (dragged) {
        zoom = span;
        paintAll(host);
      } else send("Scrub", { time: span[0] });
    });
    canvas.addEventListener("dblclick", () => {
      zoom = null;
      paintAll(host);
    });
    return chart;
  }

  // Pictures of the run side by side; a click goes to that time.
  function strip(chart) {
    chart.canvas.hidden = true;
    chart.box.querySelector(".picture").hidden = true;
    chart.strip.replaceChildren(
      ...chart.data.poses.map(([time, svg]) => {
        const one = make("button", {
          className: "pose",
          title: "Look there",
          onclick: () => send("Scrub", { time }),
        });
        one.innerHTML = svg;
        one.append(
          make("span", { className: "muted", textContent: `${Number(time.toPrecision(4))} s` }),
        );
        return one;
      }),
      ...(chart.data.poses.length
        ? []
        : [
            make("span", {
              className: "muted",
              textContent: chart.data.none || "after the live run",
            }),
          ]),
    );
  }

  function save({ canvas, data }) {
    const picture = make("canvas", { width: canvas.width, height: canvas.height }),
      g = pgraph.pen(picture);
    g.fillStyle = getComputedStyle(canvas).getPropertyValue("--paper");
    g.fillRect(0, 0, picture.width, picture.height);
    g.drawImage(canvas, 0, 0);
    make("a", {
      href: picture.toDataURL("image/png"),
      download: `${data.title.replace(/[^\w-]+/g, "_")}.png`,
    }).click();
  }

  // The curves of the run, then those of kept runs: {label, t, y, i, kept}, over time or over frequency.
  function lines({ data }) {
    const alone = data.curves.length === 1 && !data.rest.length; // then its label says nothing
    const own = data.curves.map((c, i) => ({ ...c, label: alone ? "" : c.label, i, kept: 0 }));
    const kept = data.kept.flatMap(({ name, curves }, k) =>
      curves.map((c, i) => ({ ...c, label: alone ? name : `${name}, ${c.label}`, i, kept: k + 1 })),
    );
    return [...own, ...kept];
  }
  // Amplitudes of a curve over the frequency: Hann's window on 2^n even samples, of which as few as it has points are made.
  function amplitudes(line, [t0, t1]) {
    const seen = line.t.filter((t) => t >= t0 && t <= t1).length;
    if (seen < 8) return { ...line, t: [], y: [] };
    const n = 2 ** Math.min(12, Math.ceil(Math.log2(seen))),
      [from, to] = [Math.max(t0, line.t[0]), Math.min(t1, line.t.at(-1))],
      span = to - from;
    let at = 0;
    const values = Array.from({ length: n }, (_, k) => {
      const time = from + (span * k) / n;
      while (at < line.t.length - 2 && line.t[at + 1] < time) at++;
      const share = (time - line.t[at]) / (line.t[at + 1] - line.t[at] || 1);
      return line.y[at] + Math.min(Math.max(share, 0), 1) * (line.y[at + 1] - line.y[at]);
    });
    const mean = values.reduce((sum, v) => sum + v, 0) / n;
    const re = values.map((v, k) => ((v - mean) * (1 - Math.cos((2 * Math.PI * k) / n))) / 2),
      im = new Array(n).fill(0);
    transform(re, im);
    const y = Array.from({ length: n / 2 }, (_, k) => (4 * Math.hypot(re[k], im[k])) / n),
      least = LOUD * Math.max(...y);
    const last = Math.max(8, y.findLastIndex((v) => v > least) + 2);
    return { ...line, t: y.slice(0, last).map((_, k) => k / span), y: y.slice(0, last) };
  }
  // The discrete Fourier transform in place, of a power of two (Cooley and Tukey 1965).
  function transform(re, im) {
    const n = re.length;
    for (let i = 1, j = 0; i < n; i++) {
      let bit = n >> 1;
      for (; j & bit; bit >>= 1) j ^= bit;
      j ^= bit;
      if (i < j) {
        [re[i], re[j]] = [re[j], re[i]];
        [im[i], im[j]] = [im[j], im[i]];
      }
    }
    for (let half = 1; half < n; half *= 2)
      for (let k = 0; k < n; k++) {
        if (k & half) continue;
        const a = (-Math.PI * (k % half)) / half,
          [c, s] = [Math.cos(a), Math.sin(a)],
          o = k + half;
        const [x, y] = [c * re[o] - s * im[o], s * re[o] + c * im[o]];
        [re[o], im[o], re[k], im[k]] = [re[k] - x, im[k] - y, re[k] + x, im[k] + y];
      }
  }

  function extent(all) {
    let [t0, t1] = [Infinity, -Infinity];
    for (const { t } of all)
      if (t.length) {
        t0 = Math.min(t0, t[0]);
        t1 = Math.max(t1, t[t.length - 1]);
      }
    if (zoom && (zoom[1] <= t0 || zoom[0] >= t1)) zoom = null; // of a run that was elsewhere
    if (zoom) [t0, t1] = zoom;
    if (!(t1 > t0)) return null;
    const scales = [...new Set(all.map(({ unit }) => unit))].map((unit) =>
      scale(
        all.filter((line) => line.unit === unit),
        t0,
        t1,
      ),
    );
    return { t0, t1, scales };
  }
  // The range of the curves of one unit.
  function scale(some, t0, t1) {
    let [y0, y1] = [Infinity, -Infinity];
    for (const { t, y } of some)
      for (let i = 0; i < t.length; i++) {
        if (t[i] >= t0 && t[i] <= t1) {
          y0 = Math.min(y0, y[i]);
          y1 = Math.max(y1, y[i]);
        }
      }
    if (!(y1 >= y0)) [y0, y1] = [0, 1];
    const least = 1e-9 * Math.max(Math.abs(y0), Math.abs(y1)) || 1e-12; // rounding is not blown up
    if (y1 - y0 < least) {
      y0 -= least;
      y1 += least;
    }
    const room = 0.06 * (y1 - y0);
    return {
      unit: some[0].unit,
      y0: y0 - room,
      y1: y1 + room,
      alone: some.length === 1 ? some[0] : null,
    };
  }

  function inSight(all) {
    const view = extent(all);
    return view && [view.t0, view.t1];
  }
  function timeAt(chart, x) {
    const { t0, t1 } = chart.extent ?? { t0: 0, t1: 1 },
      [LEFT, RIGHT] = chart.sides ?? sides(chart.canvas),
      width = chart.canvas.clientWidth - LEFT - RIGHT;
    return t0 + (t1 - t0) * Math.min(1, Math.max(0, (x - LEFT) / width));
  }

  // Round steps: 1, 2 or 5 times a power of ten.
  function ticks(low, high, most) {
    const raw = (high - low) / most,
      power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
    return { step, at: found };
  }
  function label(value, step) {
    if (Math.abs(value) < 1e-3 * step) return "0";
    const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return Math.abs(value) >= 1e5 || decimals > 4
      ? value.toExponential(1)
      : value.toFixed(decimals);
  }

  function paintAll(host) {
    for (const chart of charts) paint(chart);
  }

  function paint(chart) {
    if (chart.data.kind === "poses") return;
    const { canvas } = chart,
      width = canvas.clientWidth,
      HEIGHT = heightOf(canvas),
      ratio = window.devicePixelRatio || 1;
    let [LEFT, RIGHT] = (chart.sides = sides(canvas));
    if (!width) return;
    canvas.width = width * ratio;
    canvas.height = HEIGHT * ratio;
    const g = pgraph.pen(canvas),
      style = getComputedStyle(canvas);
    const color = (i) => style.getPropertyValue(`--s${i % SERIES}`);
    const ink = style.getPropertyValue("--ink"),
      soft = style.getPropertyValue("--soft"),
      line = style.getPropertyValue("--line");
    g.scale(ratio, ratio);
    g.font = `11px ${style.fontFamily}`;
    const own = lines(chart),
      span = inSight(own);
    const all = spectra && span ? own.map((line) => amplitudes(line, span)) : own,
      kept = zoom;
    if (spectra) zoom = null; // it is of time
    const view = (chart.extent = extent(all));
    zoom = kept;
    if (!view) {
      g.fillStyle = soft;
      g.fillText(chart.data.none || "no run yet", LEFT, HEIGHT / 2, width - LEFT);
      legend(chart, []);
      return;
    }
    const several = view.scales.length > 1,
      top = several ? UNITS : TOP;
    RIGHT = chart.sides[1] = Math.max(RIGHT, AXIS * (view.scales.length - 1));
    const x = (t) => LEFT + ((t - view.t0) / (view.t1 - view.t0)) * (width - LEFT - RIGHT);
    const y = view.scales.map(
      ({ y0, y1 }) =>
        (v) =>
          top + ((y1 - v) / (y1 - y0)) * (HEIGHT - top - BOTTOM),
    );
    const of = new Map(view.scales.map(({ unit }, k) => [unit, y[k]]));
    axes(g, view, x, y, width, HEIGHT, [LEFT, RIGHT], { soft, line, color });
    g.save();
    g.beginPath();
    g.rect(LEFT, top, width - LEFT - RIGHT, HEIGHT - top - BOTTOM);
    g.clip();
    for (const line of all.toReversed())
      curve(g, line, x, of.get(line.unit), color(line.i), dashes(line), line.kept ? 0.7 : 1);
    if (chart.band) {
      g.fillStyle = `${style.getPropertyValue("--accent")}26`;
      g.fillRect(chart.band[0], top, chart.band[1] - chart.band[0], HEIGHT);
    }
    g.fillStyle = soft;
    if (!spectra)
      for (const t of chart.data.impacts) {
        g.beginPath();
        g.moveTo(x(t) - 4, top);
        g.lineTo(x(t) + 4, top);
        g.lineTo(x(t), top + 7);
        g.fill();
      }
    g.strokeStyle = ink;
    g.lineWidth = 1;
    if (!spectra) {
      g.beginPath();
      g.moveTo(x(cursor), top);
      g.lineTo(x(cursor), HEIGHT);
      g.stroke();
    }
    g.restore();
    const at = chart.hover !== null ? timeAt(chart, chart.hover) : spectra ? null : cursor;
    legend(
      chart,
      all.map((line) => [
        line.label,
        color(line.i),
        at === null ? null : valueAt(line, at),
        dashes(line),
        several ? ` ${line.unit}` : "",
      ]),
    );
    if (chart.data.rest.length)
      chart.legend.append(
        make("span", {
          className: "entry muted",
          title: chart.data.rest.join(", "),
          textContent: `${chart.data.rest.length > 3 ? `${chart.data.rest.length} others` : chart.data.rest.join(", ")} 0`,
        }),
      );
    if (chart.data.impacts.length && !spectra)
      chart.legend.append(
        make("span", {
          className: "entry muted",
          title:
            "An impact at a limit is an impulse [N m s, N s], which no torque or force over time shows",
          textContent: `▾ ${chart.data.impacts.length} at a limit`,
        }),
      );
    measures(chart, own, span);
  }
  // Of the first eight curves, the next and the ones after; of each kept run another.
  const dashes = ({ i, kept }) =>
    kept ? KEPT[(kept - 1) % KEPT.length] : DASHES[Math.floor(i / SERIES) % DASHES.length];

  // The part of a curve between two times, with its values at both.
  function within({ t, y }, t0, t1) {
    const found = [];
    t.forEach((at, i) => {
      const line = (time) => [
        time,
        y[i - 1] + ((time - t[i - 1]) / (at - t[i - 1])) * (y[i] - y[i - 1]),
      ];
      if (i && t[i - 1] < t0 && at > t0) found.push(line(t0));
      if (at >= t0 && at <= t1) found.push([at, y[i]]);
      if (i && t[i - 1] < t1 && at > t1) found.push(line(t1));
    });
    return found;
  }
  function overTime(seen) {
    let [low, high, area, square] = [Infinity, -Infinity, 0, 0];
    seen.forEach(([at, v], i) => {
      low = Math.min(low, v);
      high = Math.max(high, v);
      if (!i) return;
      const [before, u] = seen[i - 1],
        dt = at - before;
      area += (dt * (u + v)) / 2;
      square += (dt * (u * u + u * v + v * v)) / 3;
    });
    const span = seen.at(-1)[0] - seen[0][0];
    return { low, high, mean: area / span, rms: Math.sqrt(square / span) };
  }
  // Between the samples i - 1 and i: the time at which a curve has this value.
  const crossing = (seen, i, value) =>
    seen[i - 1][0] +
    ((value - seen[i - 1][1]) / (seen[i][1] - seen[i - 1][1])) * (seen[i][0] - seen[i - 1][0]);

  // Overshoot and settling time of a step. It has settled if its last part varies by less than BAND of its way from the start
  // to the mean of that part. Where it returns to its start there is none.
  function stepped(seen, { low, high }) {
    const [start, value] = seen[0],
      end = seen.at(-1)[0];
    const last = overTime(
      within(
        { t: seen.map(([at]) => at), y: seen.map(([, v]) => v) },
        end - LAST * (end - start),
        end,
      ),
    );
    const way = last.mean - value,
      size = Math.abs(way),
      spread = last.high - last.low,
      least = BAND * (high - low);
    if (size <= least && spread <= least) return null;
    if (spread > BAND * size) return { settled: false };
    const band = BAND * size,
      out = seen.findLastIndex(([, v]) => Math.abs(v - last.mean) > band);
    const edge = last.mean + Math.sign(seen[out][1] - last.mean) * band;
    return {
      settled: true,
      final: last.mean,
      overshoot: Math.max(0, way > 0 ? high - last.mean : last.mean - low) / size,
      time: crossing(seen, out + 1, edge) - start,
    };
  }
  // Cycles a second, of at least two, or null. Each swing to the other side of a value is timed halfway between its two extremes:
  // of a decaying oscillation these times are evenly apart, whatever the value, as the crossings of one value are not.
  function frequency(seen, { low, high }, middle) {
    const extremes = [],
      least = LOUD * (high - low); // smaller swings count as none
    let side = 0;
    seen.forEach(([, v], i) => {
      const now = Math.abs(v - middle) > least ? Math.sign(v - middle) : side;
      if (now && now !== side) extremes.push(i);
      else if (now && now * (v - seen[extremes.at(-1)][1]) > 0) extremes[extremes.length - 1] = i;
      side = now;
    });
    const whole = extremes.filter((i) => i && i < seen.length - 1); // the others may go on out of sight
    const times = whole.slice(1).map((to, k) => {
      const from = whole[k],
        half = (seen[from][1] + seen[to][1]) / 2,
        sign = Math.sign(seen[to][1] - half);
      let i = from + 1;
      while (sign * (seen[i][1] - half) < 0) i++;
      return crossing(seen, i, half);
    });
    const cycles = Math.floor((times.length - 1) / 2);
    return cycles < 2 ? null : cycles / (times[2 * cycles] - times[0]);
  }
  // What the ruler says of a curve from t0 to t1, or null. Of what varies by rounding of `scale` it names no step and no frequency.
  function figures(line, [t0, t1], scale) {
    const seen = within(line, t0, t1);
    if (seen.length < 2) return null;
    const found = overTime(seen),
      varies = found.high - found.low > NOISE * scale;
    const step = varies ? stepped(seen, found) : null;
    return {
      ...found,
      step,
      frequency: varies ? frequency(seen, found, step?.final ?? found.mean) : null,
    };
  }
  // Four digits, and none below the error in one digit.
  function digits(value, error = 0) {
    const last = error > 0 ? 10 ** Math.floor(Math.log10(Number(error.toPrecision(1)))) : 0;
    return Number((last ? Math.round(value / last) * last : value).toPrecision(4))
      .toString()
      .replace("-", "−");
  }
  const largest = (all) => Math.max(0, ...all.flatMap(({ y }) => y.map(Math.abs)));

  function measures(chart, all, span) {
    chart.table.hidden = !measured || !span;
    if (chart.table.hidden) return;
    const few = (x) => digits(x),
      sure = (x) => digits(x, chart.data.error),
      scale = largest(all);
    const row = (one) => {
      const found = figures(one, span, scale);
      if (!found) return [one.label, ...Array(7).fill("–")];
      const { low, high, mean, rms, step, frequency: often } = found;
      const said = (text) => (!step ? "–" : step.settled ? text() : "not settled");
      return [
        one.label,
        ...[low, high, mean, rms].map(sure),
        said(() => `${few(100 * step.overshoot)} %`),
        said(() => `${few(step.time)} s`),
        often === null ? "–" : `${few(often)} Hz`,
      ];
    };
    const line = (tag) => (cells) =>
      make("tr", {}, ...cells.map((textContent) => make(tag, { textContent })));
    chart.table.replaceChildren(
      line("th")(["", "min", "max", "mean", "RMS", "overshoot", "settles in", "frequency"]),
      ...all.map(row).map(line("td")),
    );
  }

  // The axis of the first unit is at the left, the others are at the right. One of a single curve has its colour.
  function axes(g, view, x, y, width, HEIGHT, [LEFT, RIGHT], { soft, line, color }) {
    const across = ticks(view.t0, view.t1, Math.max(2, width / 80)),
      several = view.scales.length > 1;
    g.strokeStyle = line;
    g.lineWidth = 1;
    g.textBaseline = "middle";
    view.scales.forEach(({ y0, y1, unit, alone }, k) => {
      const up = ticks(y0, y1, Math.max(4, HEIGHT / 45)),
        at = k ? width - RIGHT + 5 + AXIS * (k - 1) : LEFT - 5;
      g.fillStyle = several && alone ? color(alone.i) : soft;
      g.textAlign = k ? "left" : "right";
      for (const v of up.at) {
        if (!k) {
          g.beginPath();
          g.moveTo(LEFT, y[k](v));
          g.lineTo(width - RIGHT, y[k](v));
          g.stroke();
        }
        g.fillText(label(v, up.step), at, y[k](v));
      }
      if (several) g.fillText(`[${unit}]`, at, TOP);
    });
    g.fillStyle = soft;
    g.textAlign = "center";
    g.textBaseline = "top";
    for (const t of across.at)
      g.fillText(label(t, across.step), Math.min(x(t), width - 14), HEIGHT - BOTTOM + 4);
    g.textAlign = "right";
    g.textBaseline = "bottom";
    g.fillText(spectra ? "frequency [Hz]" : "time [s]", width - RIGHT, HEIGHT);
  }

  function curve(g, { t, y: values }, x, y, color, dash, alpha) {
    g.strokeStyle = color;
    g.lineWidth = alpha < 1 ? 1.2 : 1.6;
    g.globalAlpha = alpha;
    g.setLineDash(dash);
    g.beginPath();
    for (let i = 0; i < t.length; i++) g.lineTo(x(t[i]), y(values[i]));
    g.stroke();
    g.setLineDash([]);
    g.globalAlpha = 1;
  }

  function valueAt({ t, y }, time) {
    if (!t.length) return null;
    let low = 0,
      high = t.length - 1;
    while (high - low > 1) {
      const mid = (low + high) >> 1;
      if (t[mid] > time) high = mid;
      else low = mid;
    }
    return Math.abs(t[low] - time) < Math.abs(t[high] - time) ? y[low] : y[high];
  }

  function legend(chart, entries) {
    chart.legend.replaceChildren(
      ...entries.map(([name, color, value, dash, unit]) => {
        const style = dash.length === 0 ? "solid" : dash[0] > 2 ? "dashed" : "dotted";
        const noise = NOISE * largest(chart.data.curves);
        const said =
          value === null ? "" : Math.abs(value) < noise ? "0" : digits(value, chart.data.error);
        return make(
          "span",
          { className: "entry" },
          Object.assign(make("span", { className: "dash" }), {
            style: `border-top-color:${color};border-top-style:${style}`,
          }),
          `${name} `,
          make("b", { textContent: said && said + unit }),
        );
      }),
    );
  }

  function follow(host, moment) {
    cursor = moment[0];
    paintAll(host);
  }

  Object.assign(pgraph, { amplitudes, figures, ticks, tick: label });
  pgraph.on("opened", () => {
    zoom = null;
  });
  pgraph.view("plots", {
    build,
    plots: draw,
    signals: choices,
    playback: (host, data) => follow(host, data.moment),
    time: follow,
    theme: (host) => setTimeout(() => paintAll(host), 300),
  });
})();

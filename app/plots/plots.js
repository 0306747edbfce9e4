// Plots: quantities to choose from, charts that share their time axis, and a cursor that follows
// playback.
(() => {
  const { make, send } = pgraph;
  const { NOISE, amplitudes, digits, figures, label, largest, scale, ticks } = pgraph.curves;
  const SERIES = 8; // colours, which the style has as --s0 and so on
  const DASHES = [[], [6, 3], [2, 2]],
    KEPT = [
      [5, 3],
      [2, 2],
      [8, 2, 2, 2],
      [1, 3],
      [8, 4],
    ]; // [px]
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
        said(() => (step.overshoot === null ? "–" : `${few(100 * step.overshoot)} %`)),
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

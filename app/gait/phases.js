// What each foot does, as coloured bars under the timeline; a click there scrubs.
(() => {
  const { make, send } = pgraph;
  const COLORS = ["--swing", "--acceptance", "--slip", "--stance"]; // in the order of the phases
  const THUMB = 16; // [px] of the slider: its ends stand half of it inside
  const ROW = 9, GAP = 3;

  function build(host) {
    const canvas = make("canvas", { className: "bars", title: "Phases of the feet: click to look there" });
    const scrub = (event) => {
      const box = canvas.getBoundingClientRect(), [from, to] = range();
      send("Scrub", { time: from + (to - from) * Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1) });
    };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); scrub(event); });
    canvas.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
    host.replaceChildren(make("div", { className: "feet", hidden: true }, make("div", { className: "names" }), canvas), make("div", { className: "phase-legend muted", hidden: true }));
    new ResizeObserver(() => paint(host)).observe(host); // the slider has another width then, and the bars have its
    new ResizeObserver(() => scrolls(host)).observe(host.firstChild); // its height follows the window's
  }

  // The bars have the scale of the slider above them.
  function range() {
    const [, start, end] = pgraph.latest.time ?? pgraph.latest.playback?.moment ?? [0, 0, 0];
    return [start, Math.max(end, start + 1e-3)];
  }
  function align(host, canvas) {
    const slider = document.querySelector(".scrub")?.getBoundingClientRect(), feet = host.querySelector(".feet").getBoundingClientRect();
    if (!slider?.width || !feet.width) return;
    const left = Math.round(slider.left - feet.left + THUMB / 2), wide = Math.round(slider.width - THUMB);
    host.querySelector(".names").style.width = `${Math.max(left - 8, 0)}px`;
    canvas.style.width = `${wide}px`;
  }

  function draw(host, data) {
    const feet = host.querySelector(".feet"), legend = host.querySelector(".phase-legend");
    feet.hidden = legend.hidden = !data.feet.length;
    if (feet.hidden) return;
    const key = data.feet.join();
    if (feet.dataset.key !== key) {
      feet.dataset.key = key;
      host.querySelector(".names").replaceChildren(...data.feet.map((foot) => make("div", { textContent: spoken(foot), title: foot })));
      const order = [3, 0, 1, 2].filter((k) => data.phases[k]);
      legend.replaceChildren(...order.map((k) => make("span", {}, swatch(k), data.phases[k])), make("span", { className: "all" }));
    }
    paint(host); // which gives the bars their height
    scrolls(host);
  }
  function scrolls(host) {
    const feet = host.querySelector(".feet"), hidden = feet.scrollHeight > feet.clientHeight + GAP;
    const all = host.querySelector(".phase-legend .all");
    if (all) all.textContent = hidden ? `${feet.querySelectorAll(".names > *").length} contacts: scroll` : "";
  }
  function swatch(k) {
    const chip = make("span", { className: "chip" });
    chip.style.background = `var(${COLORS[k]})`;
    return chip;
  }
  const spoken = (foot) => foot.replaceAll("_", " ").replace(/ foot$/, "");

  // Only the picture: the numbers are those of the topic.
  function paint(host) {
    const data = pgraph.latest.phases, canvas = host.querySelector("canvas.bars");
    if (!data?.feet.length || !canvas.clientWidth) return;
    align(host, canvas);
    const scale = window.devicePixelRatio || 1, wide = canvas.clientWidth, tall = data.feet.length * (ROW + GAP) - GAP;
    canvas.style.height = `${tall}px`;
    if (canvas.width !== Math.round(wide * scale) || canvas.height !== Math.round(tall * scale)) {
      canvas.width = Math.round(wide * scale);
      canvas.height = Math.round(tall * scale);
    }
    const pen = pgraph.pen(canvas), style = getComputedStyle(host);
    const colors = COLORS.map((name) => style.getPropertyValue(name));
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, wide, tall);
    const [from, to] = range(), [time, , end] = pgraph.latest.time ?? pgraph.latest.playback.moment;
    const x = (t) => wide * Math.min(Math.max((t - from) / (to - from), 0), 1);
    const last = data.feet.map(() => null);
    const fill = (foot, until) => {
      const now = last[foot];
      if (!now || until <= from || now[1] >= to) return;
      pen.fillStyle = colors[now[2]];
      pen.fillRect(x(now[1]), foot * (ROW + GAP), Math.max(x(until) - x(now[1]), 1), ROW);
    };
    for (const change of data.changes) {
      fill(change[0], change[1]);
      last[change[0]] = change;
    }
    last.forEach((_, foot) => fill(foot, end));
    pen.fillStyle = style.getPropertyValue("--ink");
    pen.fillRect(Math.min(x(time), wide - 1.5), 0, 1.5, tall);
  }

  // The playback's topics move the cursor: both come over the same way as the phases.
  pgraph.view("phases", { build, phases: draw, time: paint, theme: (host) => setTimeout(() => paint(host), 300), playback: (host) => { pgraph.latest.time = pgraph.latest.playback.moment; paint(host); } });
})();

// What each foot does, as lanes under the time: in the colour of its body where it touches, and in
// the colour of a warning where it slips. A click looks there.
(() => {
  const { make, send } = pgraph;
  const [SWING, SLIP] = [0, 2]; // of the phases
  const ROW = 8,
    GAP = 5,
    ROUND = 2,
    SEEN = 2,
    AHEAD = 0.4; // [px], the least width of a slip that is seen; opacity

  function build(host) {
    const canvas = make("canvas", {
      className: "bars",
      title: "Coloured while the foot touches, amber while it slips. Click to go to that time.",
    });
    const scrub = (event) => {
      const box = canvas.getBoundingClientRect(),
        [from, to] = range();
      send("Scrub", {
        time: from + (to - from) * Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1),
      });
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      scrub(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) scrub(event);
    });
    host.replaceChildren(
      make("div", { className: "feet", hidden: true }, make("div", { className: "names" }), canvas),
    );
    new ResizeObserver(() => paint(host)).observe(host);
  }

  function range() {
    const [, start, end] = pgraph.latest.time ?? pgraph.latest.playback?.moment ?? [0, 0, 0];
    return [start, Math.max(end, start + 1e-3)];
  }

  function draw(host, data) {
    const feet = host.querySelector(".feet"),
      key = data.feet.join();
    feet.hidden = !data.feet.length;
    if (feet.hidden) return;
    if (feet.dataset.key !== key) {
      feet.dataset.key = key;
      host
        .querySelector(".names")
        .replaceChildren(
          ...data.feet.map((foot) =>
            make("div", {
              textContent: foot.replaceAll("_", " ").replace(/ foot$/, ""),
              title: foot,
            }),
          ),
        );
    }
    paint(host);
  }

  // Only the picture: the numbers are those of the topic.
  function paint(host) {
    const data = pgraph.latest.phases,
      canvas = host.querySelector("canvas.bars");
    if (!data?.feet.length || !canvas.clientWidth) return;
    const scale = window.devicePixelRatio || 1,
      wide = canvas.clientWidth,
      tall = data.feet.length * (ROW + GAP) - GAP;
    canvas.style.height = `${tall}px`;
    if (canvas.width !== Math.round(wide * scale) || canvas.height !== Math.round(tall * scale)) {
      canvas.width = Math.round(wide * scale);
      canvas.height = Math.round(tall * scale);
    }
    const pen = pgraph.pen(canvas),
      style = getComputedStyle(host),
      ink = (name) => style.getPropertyValue(name);
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, wide, tall);
    const [from, to] = range(),
      [time, , end] = pgraph.latest.time ?? pgraph.latest.playback.moment;
    const x = (t) => wide * Math.min(Math.max((t - from) / (to - from), 0), 1);
    const bars = () =>
      data.feet.forEach((_, foot) => {
        const joined = []; // the phases of one step are one bar
        for (const span of spans(foot, (phase) => phase !== SWING))
          if (joined.at(-1)?.[1] === span[0]) joined.at(-1)[1] = span[1];
          else joined.push(span);
        for (const [left, right] of joined)
          if (right > left) box(ink(data.colors[foot].slice(4, -1)), left, right - left, foot);
        for (const [left, right] of spans(foot, (phase) => phase === SLIP))
          if (right - left >= SEEN) box(ink("--warn"), left, right - left, foot);
      });
    const box = (color, left, width, foot) => {
      pen.fillStyle = color;
      pen.beginPath();
      pen.roundRect(left, foot * (ROW + GAP), Math.max(width, 1), ROW, ROUND);
      pen.fill();
    };
    const lasts = data.feet.map((_, foot) => data.changes.filter((change) => change[0] === foot));
    const spans = (foot, is) =>
      lasts[foot].flatMap(([, t, phase], k, all) =>
        is(phase) ? [[x(t), x(all[k + 1]?.[1] ?? end)]] : [],
      );
    data.feet.forEach((_, foot) => box(ink("--field-hover"), 0, wide, foot));
    pen.globalAlpha = AHEAD;
    bars();
    pen.globalAlpha = 1;
    pen.save(); // what has been is stronger than what is to come
    pen.beginPath();
    pen.rect(0, 0, x(time), tall);
    pen.clip();
    bars();
    pen.restore();
    pen.fillStyle = ink("--ink");
    pen.fillRect(Math.min(Math.max(x(time) - 0.75, 0), wide - 1.5), 0, 1.5, tall);
  }

  // The playback's topics move the cursor: both come over the same way as the phases.
  pgraph.view("phases", {
    build,
    phases: draw,
    time: paint,
    theme: (host) => setTimeout(() => paint(host), 300),
    playback: paint,
  });
})();

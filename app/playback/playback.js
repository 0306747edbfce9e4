// Time: to the start, a frame back or on, the clock, speed, repeat, and the slider.
(() => {
  const { make, send, icon } = pgraph;
  let dragging = false;

  function build(host) {
    const button = (className, title, onclick) =>
      make(
        "button",
        { className: `bare ${className}`, title, onclick, "aria-label": title },
        icon({ back: "start" }[className] ?? className),
      );
    const slider = make("input", {
      type: "range",
      min: 0,
      max: 1,
      step: "any",
      className: "scrub",
      "aria-label": "time",
    });
    const scrub = () => send("Scrub", { time: Number(slider.value), held: dragging });
    slider.addEventListener("pointerdown", () => {
      dragging = true;
    });
    for (const over of ["pointerup", "pointercancel"])
      window.addEventListener(over, () => {
        if (dragging) {
          dragging = false;
          scrub();
        }
      });
    slider.addEventListener("input", () => {
      scrub();
      told(host, Number(slider.value));
    });
    const speed = make("select", {
      className: "cell speed",
      title: "Speed of playback",
      "aria-label": "speed",
      onchange: () => send("Speed", { speed: Number(speed.value) }),
    });
    const plots = make(
      "button",
      { className: "bare plots", title: "Curves of the run" },
      icon("plots"),
      make("span", { textContent: "Plots" }),
    );
    plots.onclick = () => {
      if (pgraph.frame.isFront("Plots")) pgraph.frame.drawer(false);
      else pgraph.front("Plots");
    };
    host.replaceChildren(
      make(
        "div",
        { className: "transport" },
        button("back", "to the start", () => send("Scrub", { time: Number(slider.min) })),
        button("less", "one frame back", () => send("StepFrames", { frames: -1 })),
        button("more", "one frame on", () => send("StepFrames", { frames: 1 })),
        make("output", { className: "time" }, make("span"), make("span", { className: "total" })),
        make("span", { className: "spring" }),
        speed,
        button("loop", "repeat", () => send("Loop", { loop: !pgraph.latest.playback.loop })),
        make("span", { className: "rule" }),
        plots,
      ),
      slider,
      make("div", { className: "ticks" }),
    );
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector),
      none = data.moment[2] <= data.moment[1];
    for (const control of host.querySelectorAll("button:not(.plots), input, select"))
      control.disabled = none;
    $(".loop").setAttribute("aria-pressed", data.loop);
    $(".loop").hidden = data.live;
    const speed = $(".speed");
    if (speed.options.length !== data.speeds.length)
      speed.replaceChildren(
        ...data.speeds.map((s) => make("option", { value: s, textContent: `${s}×` })),
      );
    speed.value = String(data.speed);
    move(host, data.moment);
  }

  function move(host, moment) {
    const [time, start, end] = moment,
      slider = host.querySelector(".scrub");
    host.pgraphEnd = end;
    ticks(host.querySelector(".ticks"), start, end);
    if (dragging) return;
    slider.min = start;
    slider.max = end > start ? end : start + 1;
    slider.value = time;
    told(host, time);
  }
  function ticks(box, start, end) {
    if (box.dataset.of === `${start} ${end}`) return;
    box.dataset.of = `${start} ${end}`;
    const { at, step } = end > start ? pgraph.curves.ticks(start, end, 10) : { at: [] };
    box.replaceChildren(
      ...at.map((t) =>
        Object.assign(make("span", { textContent: pgraph.curves.label(t, step) }), {
          style:
            `left:${(100 * (t - start)) / (end - start)}%` +
            (end - t < step / 2 ? ";translate:-100%" : ""),
        }),
      ),
    );
  }
  function told(host, time) {
    const [now, total] = host.querySelector(".time").children;
    now.textContent = time.toFixed(3);
    total.textContent = ` / ${(host.pgraphEnd ?? 0).toFixed(3)} s`;
  }

  pgraph.view("playback", { build, playback: draw, time: move });
})();

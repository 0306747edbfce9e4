// The playback bar: play, step, scrub, speed, loop.
(() => {
  const { make, send } = pgraph;
  let dragging = false;
  // Play simulates first where nothing has been computed; what is simulated plays.
  pgraph.play = () => {
    const { playing, nothing } = pgraph.latest.playback ?? {};
    send(nothing ? "Simulate" : playing ? "Pause" : "Play");
  };

  function build(host) {
    const button = (className, icon, title, onclick) =>
      make("button", { className: `action ${className}`, title, onclick, "aria-label": title }, pgraph.icon(icon));
    const slider = make("input", { type: "range", min: 0, max: 1, step: "any", className: "scrub", "aria-label": "time" });
    slider.addEventListener("pointerdown", () => { dragging = true; });
    window.addEventListener("pointerup", () => { dragging = false; });
    slider.addEventListener("input", () => { send("Scrub", { time: Number(slider.value) }); told(host, Number(slider.value)); });
    const speed = make("select", { className: "cell speed", title: "speed", "aria-label": "speed", onchange: () => send("Speed", { speed: Number(speed.value) }) });
    host.replaceChildren(make("div", { className: "transport" },
      button("back", "start", "to the start", () => send("Scrub", { time: Number(slider.min) })),
      button("less", "less", "one frame back", () => send("StepFrames", { frames: -1 })),
      button("primary play", "play", "play (space)", pgraph.play),
      button("more", "more", "one frame on", () => send("StepFrames", { frames: 1 })),
      slider, make("output", { className: "time" }, make("span"), make("span", { className: "total" })), speed,
      button("loop", "loop", "repeat", () => send("Loop", { loop: !pgraph.latest.playback.loop }))),
    make("div", { className: "muted none" }));
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    const none = data.moment[2] <= data.moment[1];
    for (const control of host.querySelectorAll("button, input, select")) control.disabled = none;
    $(".play").disabled = none && data.blocked; // it simulates where there is nothing yet
    $(".none").hidden = !none;
    $(".none").textContent = $(".none").title = data.hint;
    $(".transport").classList.toggle("off", none);
    $(".play").replaceChildren(pgraph.icon(data.playing ? "pause" : "play"));
    $(".play").title = data.playing ? "pause (space)" : "play (space)";
    $(".play").setAttribute("aria-label", data.playing ? "pause" : "play");
    $(".loop").classList.toggle("on", data.loop);
    $(".loop").setAttribute("aria-pressed", data.loop);
    const speed = $(".speed");
    if (speed.options.length !== data.speeds.length) {
      speed.replaceChildren(...data.speeds.map((s) => make("option", { value: s, textContent: `${s}×` })));
    }
    speed.value = String(data.speed);
    $(".loop").hidden = data.live;
    move(host, data.moment);
  }

  function move(host, moment) {
    const [time, start, end] = moment, slider = host.querySelector(".scrub");
    host.pgraphEnd = end;
    if (dragging) return;
    slider.min = start;
    slider.max = end > start ? end : start + 1;
    slider.value = time;
    told(host, time);
  }
  function told(host, time) {
    const end = host.pgraphEnd ?? 0;
    const [now, total] = host.querySelector(".time").children;
    now.textContent = time.toFixed(3);
    total.textContent = ` / ${end.toFixed(3)} s`;
  }

  pgraph.view("playback", { build, playback: draw, time: move });
})();

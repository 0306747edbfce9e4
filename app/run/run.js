// What is run: the scenario, the one Play, Run or Live, and the settings of the run.
(() => {
  const { make, text, cells, send, icon } = pgraph;
  let mode = "run",
    went = false; // what Play does where nothing runs: compute and show, or "live"; whether a live run was going

  // With what stands in the settings, or not at all: what is being typed is taken first, what is refused is reported.
  function asSet(event) {
    document.activeElement?.blur();
    const box = document.querySelector(".pgraph-popup.settings"),
      typed = [...box.querySelectorAll("input.cell")];
    const go = (patience) => {
      if (patience && typed.some((cell) => cell.matches(".waiting"))) {
        setTimeout(go, 30, patience - 1);
        return;
      }
      const refused = typed.find((cell) => cell.matches(".refused"));
      if (!refused) {
        send(event);
        return;
      }
      pgraph.toast(
        `Nothing was simulated: the ${refused.ariaLabel} “${refused.value}” is refused. Correct it, or press Esc in its cell.`,
      );
      box.showPopover();
      refused.focus();
    };
    go(100);
  }

  // Plays what there is; computes it first where there is nothing, or nothing of this model and these settings.
  function play(anew = false) {
    const { playing, nothing } = pgraph.latest.playback ?? {},
      { job, live, outdated, empty } = pgraph.latest.run ?? {};
    if (empty || job) return;
    if (going(live)) send(playing ? "Pause" : "Play");
    else if (mode === "live") asSet("GoLive");
    else if (playing && !anew) send("Pause");
    else if (anew || nothing || outdated) asSet("Simulate");
    else send("Play");
  }
  const going = (live) => Boolean(live) && live.running !== undefined; // not yet stopped
  pgraph.play = () => play();
  pgraph.simulate = () => {
    choose("run");
    play(true);
  };

  function choose(to) {
    mode = to;
    if (to === "run" && going(pgraph.latest.run?.live)) send("StopLive");
    draw(pgraph.host("run"), pgraph.latest.run);
  }

  function build(host) {
    const scenario = cells.choice(
      () => pgraph.latest.run.scenarios,
      (serial, value) => send("SetScenario", { serial, scenario: value }),
      { label: "scenario", className: "tall" },
    );
    const button = make(
      "button",
      {
        className: "action primary play",
        onclick: (event) => {
          if (pgraph.latest.run?.job) send("Cancel");
          else play(event.shiftKey);
        },
      },
      icon("play", 14),
      text("span", "said"),
      make("progress", { max: 1, hidden: true }),
    );
    const way = (name, label, about) =>
      make("button", {
        className: name,
        textContent: label,
        title: about,
        onclick: () => choose(name),
      });
    const method = make(
      "button",
      { className: "bare method", title: "Method, duration, step and tolerance of the run" },
      icon("sliders"),
      text("span", "said"),
    );
    host.pgraphRun = { scenario };
    pgraph.opens(method, settings(host), { anchor: host }); // Play stays free
    host.replaceChildren(
      make(
        "div",
        { className: "run-line" },
        scenario,
        button,
        pgraph.pictureButton("stop", "stop", "Stop", "End the live run and keep it", () =>
          send("StopLive"),
        ),
      ),
      make(
        "div",
        { className: "run-line" },
        make(
          "div",
          { className: "modes", role: "group", "aria-label": "how to run" },
          way("run", "Run", "Compute the motion, then play it"),
          way("live", "Live", "Play while it computes: edit, pull and push meanwhile"),
        ),
        text("span", "spring"),
        method,
      ),
    );
  }

  function settings(host) {
    return make(
      "div",
      { className: "settings" },
      (host.pgraphRun.form = make("div")),
      make(
        "div",
        { className: "run-line" },
        pgraph.button(
          "keep",
          "Keep in the scenario",
          "The scenario has these settings from now on",
          () => send("KeepSettings"),
        ),
        text("span", "spring"),
        pgraph.button(
          "continue",
          "Continue",
          "Go on from the end of the run for as long again",
          () => asSet("Continue"),
        ),
      ),
    );
  }

  // A setting of the run: its label, and a list of choices or a number.
  function setting({ name, label, unit, options }) {
    const edit = (serial, value) => send("SetRun", { serial, field: name, text: value }),
      called = { label: label.toLowerCase(), numeric: true };
    const cell = options.length
      ? cells.choice(() => options, edit, called)
      : cells.input(edit, called);
    return make(
      "div",
      { className: "field" },
      make("div", { className: "what" }, text("span", "", label), text("span", "unit", unit)),
      cell,
    );
  }
  function fill(el, { value, options, placeholder, help, acts }) {
    const cell = el.lastChild;
    el.title = help[0].toUpperCase() + help.slice(1);
    cell.disabled = !acts;
    if (options.length) cells.choose(cell, value);
    else {
      cell.placeholder = placeholder;
      cells.set(cell, value ?? "");
    }
  }

  function draw(host, data) {
    if (!data) return;
    const $ = (selector) => host.querySelector(selector),
      box = document.querySelector(".pgraph-popup.settings"),
      live = going(data.live);
    const { scenario, form } = host.pgraphRun;
    if (live && !went) mode = "live"; // from another page, or by Walk
    went = live;
    cells.choose(scenario, data.request.scenario);
    pgraph.keyed(form, data.form, setting, fill);
    box.querySelector(".keep").hidden = !data.keeps;
    box.querySelector(".continue").hidden = !data.continues;
    $(".method .said").textContent = `Method: ${data.method}`;
    $(".stop").hidden = !live;
    for (const name of ["run", "live"])
      $(`.modes .${name}`).setAttribute("aria-pressed", mode === name);
    button($(".play"), data);
  }

  // What the button does now.
  function button(el, { job, live, outdated, empty, kernels }) {
    const playing = pgraph.latest.playback?.playing && !job,
      again = mode === "run" && !live && outdated,
      bar = el.querySelector("progress");
    const word = job
      ? job.fraction
        ? `Cancel ${job.text}`
        : "Cancel"
      : playing
        ? "Pause"
        : again
          ? "Run again"
          : "Play";
    if (el.dataset.icon !== (playing ? "pause" : job ? "stop" : "play")) {
      el.dataset.icon = playing ? "pause" : job ? "stop" : "play";
      el.querySelector("svg").replaceWith(icon(el.dataset.icon, 14));
    }
    el.querySelector(".said").textContent = word;
    el.title = empty
      ? "No bodies yet"
      : job
        ? "Cancel the simulation"
        : playing
          ? "Pause (Space)"
          : again
            ? `${outdated}: compute it again (Space)`
            : "Play (Space); compute it again (Shift Space)";
    el.setAttribute("aria-label", job ? "cancel" : word.toLowerCase());
    el.disabled = empty;
    bar.hidden = !job;
    if (job?.fraction) bar.value = job.fraction;
    else bar.removeAttribute("value");
    el.classList.toggle("stale", Boolean(again));
    el.classList.toggle("waits", Boolean(job) && kernels !== null);
  }

  pgraph.commands("Run", () => [
    ["Play or pause", "Space", pgraph.play],
    ["Run again", "Shift Space", pgraph.simulate, "compute the motion from the initial state"],
    [
      "Live",
      "",
      () => {
        choose("live");
        play();
      },
      "plays while it computes",
    ],
    ["Continue the run", "", () => asSet("Continue"), "for as long again"],
  ]);
  pgraph.view("run", {
    build,
    run: draw,
    playback: (host) => {
      if (pgraph.latest.run) button(host.querySelector(".play"), pgraph.latest.run);
    },
  });
})();

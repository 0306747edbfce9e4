// The walk: which gait, how fast, over what ground; and what the feet did.
(() => {
  const { make, button, text, cells, send } = pgraph;
  const MOST = 60; // lines of the log

  function build(host) {
    const walk = (field) => (serial, value) => send("SetWalk", { serial, field, text: value });
    const ground = (field) => (serial, value) => send("SetGround", { serial, field, text: value });
    const gait = cells.choice(
      () => pgraph.latest.gait.gaits ?? [],
      (serial, value) => send("SetGait", { serial, gait: value }),
      { label: "gait" },
    );
    const law = cells.choice(() => pgraph.latest.gait.laws ?? [], ground("law"), {
      label: "contact law",
    });
    const number = (send_, label) => cells.input(send_, { label, numeric: true });
    const c = {
      gait,
      law,
      speed: number(walk("speed"), "walking speed"),
      turn: number(walk("turn"), "turning"),
      strength: number((serial, text) => send("SetPush", { serial, text }), "strength of a push"),
      friction: number(ground("friction"), "friction of the ground"),
      slope: number(ground("slope"), "slope"),
      steps: number(ground("steps"), "height of steps"),
    };
    const speed = slider(c.speed, walk("speed"), "speed slider"),
      turn = slider(c.turn, walk("turn"), "turning slider");
    host.pgraphGait = { ...c, speedSlider: speed, turnSlider: turn };
    const field = (label, unit, cell, help, ...more) =>
      make(
        "div",
        { className: `field ${more.length ? "slid" : ""}`, title: help },
        make("div", { className: "what" }, text("span", "", label), text("span", "unit", unit)),
        ...more,
        cell,
      );
    host.replaceChildren(
      make("div", { className: "no-gait", hidden: true }, text("p", "muted why")),
      make(
        "div",
        { className: "gait", hidden: true },
        make(
          "div",
          { className: "field", title: "When each foot is on the ground" },
          text("div", "what", "Gait"),
          gait,
          button("walk-on", "Walk", "Walk live: what is set here acts at once", () =>
            send(pgraph.latest.gait.live ? "StopLive" : "Walk"),
          ),
        ),
        text("p", "muted about"),
        make("div", { className: "problem sentence", role: "alert", hidden: true }),
        make(
          "fieldset",
          {},
          make("legend", { textContent: "Steer" }),
          field(
            "Speed",
            "m/s",
            c.speed,
            "Forward; the speed follows as fast as the gait allows",
            speed,
          ),
          field("Turning", "rad/s", c.turn, "Positive to the left", turn),
          field(
            "Strength",
            "× weight",
            c.strength,
            "Of a push, over the weight; it lasts 0.15 s and acts on the selected body, or on the trunk",
          ),
          make(
            "div",
            { className: "pushes" },
            text("span", "muted", "Push"),
            ...["left", "right", "ahead", "back"].map((side) =>
              pgraph.pressButton(
                "push",
                side,
                `Push ${side} for 0.15 s: the selected body, or the trunk`,
                () => send("Push", { side }),
              ),
            ),
          ),
        ),
        make(
          "fieldset",
          {},
          make("legend", { textContent: "Ground" }),
          make(
            "div",
            { className: "settings" },
            field("Friction", "", c.friction, "Coulomb's coefficient under the feet"),
            field("Slope", "°", c.slope, "How steeply it rises ahead; set before a walk"),
            field(
              "Steps",
              "m",
              c.steps,
              "Height of platforms to walk over, from 1 m ahead on; 0: none. Set before a walk",
            ),
            field("Contact", "", law, "The law of the feet: rigid, or one that gives"),
          ),
        ),
      ),
    );
  }

  // A slider types into its cell, so that a refusal appears next to it.
  function slider(cell, edit, label) {
    const range = make("input", { type: "range", step: 0.01, "aria-label": label });
    range.addEventListener("input", () => {
      cell.value = range.value;
      cells.commit(cell, edit);
    });
    range.addEventListener("pointerdown", () => {
      range.dataset.held = "1";
    });
    range.addEventListener("pointerup", () => {
      delete range.dataset.held;
    });
    return range;
  }
  function slide(range, low, high, value) {
    range.min = low;
    range.max = high;
    if (!range.dataset.held) range.value = value;
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector),
      c = host.pgraphGait;
    host.hidden = !data.feet;
    $(".no-gait").hidden = !data.why;
    $(".gait").hidden = !data.walks;
    $(".why").textContent = data.why;
    if (!data.walks) return;
    cells.choose(c.gait, data.gait);
    cells.choose(c.law, data.law);
    for (const name of ["speed", "turn", "strength", "friction", "slope", "steps"])
      cells.set(c[name], data[name]);
    slide(c.speedSlider, 0, data.fastest, data.speed);
    slide(c.turnSlider, -data.turning, data.turning, data.turn);
    c.turnSlider.disabled = c.turn.disabled = !data.turns;
    c.turn.closest(".field").title = data.turns
      ? "Positive to the left"
      : "Its hips do not spread: it cannot turn";
    $(".about").textContent = data.about;
    $(".walk-on").textContent = data.live ? "Stop" : "Walk";
    $(".walk-on").disabled = data.busy;
    for (const push of host.querySelectorAll(".push")) push.disabled = !data.live;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
  }

  pgraph.view("gait", { build, gait: draw });
})();

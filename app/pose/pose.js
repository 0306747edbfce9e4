// Joint coordinates as sliders with numbers: they pose the mechanism without changing the model.
(() => {
  const { make, cells, send } = pgraph;
  const LATE = 400; // [ms] after which a slider sends again, answered or not
  const ROUNDING = 1e-9; // what a closed loop leaves of a zero
  let waiting = null, next = null; // one event under way; the last value wins

  function build(host) {
    const { button } = pgraph;
    host.replaceChildren(
      make("div", { className: "bar" }, button("use", "Use as initial state", "What is shown becomes the model's initial state: one undo step", () => send("UsePose")),
        button("home", "Reset", "Show the initial state, or the run, again", () => send("HomePose"))),
      make("div", { className: "sentence problem", role: "alert", hidden: true }), make("p", { className: "muted hint" }), make("div", { className: "joints" }));
    pgraph.inSight(host, "joints", (on) => {
      if (!on) clear(host.querySelector(".joints")); // unseen it is told nothing: soon of another model
    });
  }

  function clear(box) {
    delete box.dataset.key;
    box.replaceChildren();
  }

  function draw(host, data) {
    answered();
    if (!pgraph.inView(host)) return;
    const $ = (selector) => host.querySelector(selector);
    $(".home").disabled = !data.posed;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    $(".hint").hidden = !data.hint;
    $(".hint").textContent = data.hint;
    const box = $(".joints"), key = JSON.stringify(data.rows.map((row) => [row.body, row.index, row.label]));
    if (box.dataset.key !== key) {
      box.dataset.key = key;
      box.replaceChildren(...data.rows.map((row, i) => joint(row, data.rows[i - 1]?.body === row.body)));
    }
    const lines = box.querySelectorAll(":scope > .joint"); // between them stand sentences
    data.rows.forEach((row, i) => fill(lines[i], row, data.selected));
  }

  function joint(row, again) {
    const pose = (serial, text) => send("MoveJoint", { serial, body: row.body, index: row.index, text });
    const label = `${row.body} ${row.label}`;
    const slider = make("input", { type: "range", step: "any", "aria-label": label });
    const cell = cells.input(pose, { label: `${label} in ${row.unit}`, numeric: true });
    cell.dataset.digits = 4;
    slider.addEventListener("input", () => later(() => pose(0, slider.value)));
    slider.addEventListener("pointerdown", () => { slider.dataset.held = "1"; });
    slider.addEventListener("pointerup", () => { delete slider.dataset.held; });
    const name = make("button", { className: "of", title: row.body, onclick: () => send("Select", { body: row.body }) },
      make("span", { className: "chip" }), make("span", { textContent: row.body }));
    return make("div", { className: again ? "joint again" : "joint" }, name, make("span", { className: "muted", textContent: row.label }), slider, cell,
      make("span", { className: "unit", textContent: row.unit }));
  }

  function fill(line, row, selected) {
    const slider = line.querySelector("[type=range]");
    line.classList.toggle("selected", row.body === selected);
    line.querySelector(".chip").style.background = row.color;
    slider.min = row.low;
    slider.max = row.high;
    if (!slider.dataset.held) slider.value = row.value;
    cells.set(line.querySelector(".cell"), Math.abs(row.value) < ROUNDING ? 0 : row.value);
  }

  function later(act) {
    if (waiting) { next = act; return; }
    waiting = setTimeout(answered, LATE);
    act();
  }
  function answered() {
    clearTimeout(waiting);
    waiting = null;
    const act = next;
    next = null;
    if (act) later(act);
  }

  pgraph.view("joints", { build, joints: draw });
})();

// Joint coordinates as sliders with numbers: they pose the mechanism without changing the model.
(() => {
  const { make, cells, send } = pgraph;
  const LATE = 400; // [ms] after which a slider sends again, answered or not
  const ROUNDING = 1e-9; // what a closed loop leaves of a zero
  let waiting = null,
    next = null; // one event under way; the last value wins

  function build(host) {
    const { button } = pgraph;
    host.replaceChildren(
      make(
        "div",
        { className: "head" },
        make("h3", { textContent: "Pose" }),
        make("span", { className: "muted at" }),
        make("span", { className: "spring" }),
        button("home", "Reset", "Show the initial state, or the run, again", () =>
          send("HomePose"),
        ),
        button("use", "Start here", "What is shown becomes the initial state of the model", () =>
          send("UsePose"),
        ),
      ),
      make("div", { className: "sentence problem", role: "alert", hidden: true }),
      make("p", { className: "muted hint" }),
      make("div", { className: "joints" }),
    );
    const rows = host.querySelector(".joints");
    pgraph.inSight(host, "joints", (on) => {
      if (!on) clear(rows); // unseen it is told nothing: soon of another selection
    });
    // its place, before it is looked at
    pgraph.on("selected", (chosen) => host.classList.toggle("all", !chosen.length));
  }

  function clear(box) {
    box.replaceChildren();
  }

  function draw(host, data) {
    answered();
    if (!pgraph.inView(host)) return;
    const $ = (selector) => host.querySelector(selector);
    $(".home").hidden = $(".use").hidden = !data.posed;
    $(".at").textContent = data.shows;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    $(".hint").hidden = !data.hint;
    $(".hint").textContent = data.hint;
    const chosen = new Set(pgraph.latest.selected ?? []),
      rows = chosen.size ? data.rows.filter((row) => chosen.has(row.body)) : data.rows;
    const one = chosen.size === 1,
      items = rows.map((row, i) => ({
        id: row.id,
        name: row.body,
        row,
        again: one || rows[i - 1]?.body === row.body,
      }));
    host.firstChild.hidden = $(".joints").hidden = !rows.length;
    pgraph.keyed($(".joints"), items, joint, (line, item) => fill(line, item, data.selected));
  }

  function joint() {
    const line = make("div"),
      of = () => line.pgraphRow;
    const pose = (serial, text) =>
      send("MoveJoint", { serial, body: of().body, index: of().index, text });
    const slider = make("input", { type: "range", step: "any" });
    const cell = cells.input(pose, { label: "", numeric: true });
    cell.addEventListener("keydown", (event) => {
      const by = { Tab: event.shiftKey ? -1 : 1, Enter: 1, ArrowDown: 1, ArrowUp: -1 }[event.key];
      const all = [...document.querySelectorAll(".pgraph .joint .cell")],
        next = all[all.indexOf(cell) + by];
      if (!next) return; // from the last one Tab leaves
      event.preventDefault();
      next.focus(); // which takes what is typed
    });
    slider.addEventListener("input", () => {
      filled(slider);
      later(() => pose(0, slider.value));
    });
    slider.addEventListener("change", () =>
      pose(pgraph.nextSerial(), `${slider.value} ${of().si}`),
    ); // let go: the camera may move now
    slider.addEventListener("pointerdown", () => {
      slider.dataset.held = "1";
    });
    slider.addEventListener("pointerup", () => {
      delete slider.dataset.held;
    });
    const name = make(
      "button",
      { className: "of", onclick: () => send("Select", { body: of().body }) },
      make("span", { className: "chip" }),
      make("span"),
    );
    const plot = make(
      "button",
      {
        className: "bare plot",
        title: "Plot it over time",
        "aria-label": "plot",
        onclick: () => {
          send("Plot", { kind: "q", of: of().body, on: true });
          pgraph.front("Plots");
        },
      },
      pgraph.icon("plots", 14),
    );
    line.append(
      name,
      make("span", { className: "muted" }, make("span"), make("span", { className: "unit" })),
      slider,
      cell,
      plot,
    );
    return line;
  }

  function fill(line, { row, again }, selected) {
    const slider = line.querySelector("[type=range]"),
      name = line.firstChild,
      label = `${row.body} ${row.label}`;
    line.pgraphRow = row;
    line.className = `joint${again ? " again" : ""}${row.body === selected ? " selected" : ""}${row.more ? " turned" : ""}`;
    name.title = name.lastChild.textContent = row.body;
    line.querySelector(".muted").firstChild.textContent = `${row.label} `;
    line.querySelector(".unit").textContent = `${row.unit} ${row.more}`;
    line.querySelector(".plot").setAttribute("aria-label", `plot ${label}`);
    slider.setAttribute("aria-label", label);
    line.querySelector(".cell").setAttribute("aria-label", `${label} in ${row.unit}`);
    line.querySelector(".chip").style.setProperty("--body", row.color);
    slider.min = row.low;
    slider.max = row.high;
    if (!slider.dataset.held) slider.value = row.value;
    filled(slider);
    cells.set(line.querySelector(".cell"), Math.abs(row.value) < ROUNDING ? 0 : row.shown);
  }

  // The track is filled from zero, where it has a mark, to the value.
  function filled(slider) {
    const { min, max, value } = slider,
      share = (x) => Math.min(1, Math.max(0, (x - min) / (max - min || 1))),
      [zero, now] = [share(0), share(value)];
    for (const [name, at] of [
      ["--zero", zero],
      ["--from", Math.min(zero, now)],
      ["--to", Math.max(zero, now)],
    ])
      slider.style.setProperty(name, at.toFixed(3));
  }

  function later(act) {
    if (waiting) {
      next = act;
      return;
    }
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

  pgraph.view("joints", {
    build,
    joints: draw,
    selected: (host) => draw(host, pgraph.latest.joints ?? { rows: [] }),
  });
})();

// The scenarios, and of the one that is chosen for the run: how it starts, what acts in it, what goes on
// and off when. All of it is added by one button.
(() => {
  const { make, button, text, cells, forms, send } = pgraph;
  let adding = null; // the scenario that was asked for one more force
  const shown = () => pgraph.latest.scenario,
    now = () => shown()?.id ?? null; // the one that is shown

  function build(host) {
    pgraph.frame.actions(
      "Scenarios",
      pgraph.pictureButton(
        "bare add-scenario",
        "add",
        "Add to the scenarios",
        "A scenario, or to this one a start, a switch, a force or a motor",
        add,
      ),
    );
    host.replaceChildren(
      make(
        "div",
        { className: "scenario" },
        make("div", { className: "listed" }),
        make("p", {
          className: "muted none",
          textContent:
            "A free run has no scenario. A scenario keeps a run with the model: its initial state, the forces that act, and when constraints switch on or off.",
        }),
        make(
          "div",
          { className: "some" },
          make("div", { className: "settings-form" }),
          make("div", { className: "start-form" }),
          section("going", "Switches"),
          section("drives", "Forces and motors"),
          make("div", { className: "active-form" }),
        ),
      ),
    );
    pgraph.inSight(host, "scenario");
  }
  const section = (className, title) =>
    make("section", { className }, make("h4", { textContent: title }), text("div", "rows"));

  // On the selected body, or on the first.
  function add() {
    const { none, kinds, switchable, held } = shown(),
      scenario = now(),
      own = pgraph.latest.selection ?? null,
      body = own ?? pgraph.latest.table.rows[0]?.name;
    const into = none
      ? []
      : [
          [
            "Start",
            [
              [
                "Pose shown",
                "It becomes the initial state, with its speeds",
                () => send("TakePose", { scenario, shown: true }),
                "start pose",
              ],
              [
                "One body",
                own === null
                  ? "Select the body that starts otherwise first"
                  : held.includes(own)
                    ? `${own} has its own start`
                    : `${own} starts otherwise than in the model`,
                own !== null &&
                  !held.includes(own) &&
                  (() =>
                    send("EditScenario", {
                      serial: pgraph.nextSerial(),
                      scenario,
                      field: "bodies",
                      entries: [[[], own]],
                    })),
                "start body",
              ],
            ],
          ],
          [
            "During the run",
            [
              [
                "Switch",
                switchable.length
                  ? "A constraint goes on or off: at a time, or when something crosses a value"
                  : "There is no constraint to switch",
                switchable.length && (() => send("AddSwitch", { constraint: null })),
                "switch",
              ],
            ],
          ],
          [
            "Forces and motors",
            body === undefined
              ? []
              : kinds.map(([kind, about]) => [
                  kind,
                  about,
                  () => {
                    adding = scenario;
                    send("AddDrive", { scenario, kind, body });
                  },
                  `force ${kind}`,
                ]),
          ],
        ];
    const whole = [
      "Scenario",
      [
        ["New", "It runs as the run is set now", () => send("NewScenario"), "scenario new"],
        ...(none
          ? []
          : [
              [
                "Copy",
                "This scenario once more",
                () => send("CopyScenario", { scenario }),
                "scenario copy",
              ],
            ]),
      ],
    ];
    pgraph.choose(
      [whole, ...into],
      none
        ? "Add a scenario"
        : `Add to '${shown().name}'${body === undefined ? "" : `, on '${body}'`}`,
    );
  }

  // A scenario: its name, which of the chosen one is a cell, and how long it is.
  function one() {
    const el = make("div", { className: "field row" }),
      name = cells.input(
        (serial, value) =>
          send("EditScenario", {
            serial,
            scenario: el.pgraphItem.number,
            field: "name",
            entries: [[[], value]],
          }),
        { label: "name of the scenario" },
      );
    el.append(
      make(
        "button",
        {
          className: "title",
          onclick: () =>
            send("SetScenario", { serial: pgraph.nextSerial(), scenario: el.pgraphItem.value }),
        },
        make("strong"),
        make("span", { className: "muted" }),
      ),
      name,
      button("delete-scenario", "×", "Delete the scenario", () =>
        send("DeleteScenario", { scenario: el.pgraphItem.number }),
      ),
    );
    return el;
  }
  function fillOne(el, item, chosen) {
    const [title, name, out] = el.children,
      open = item.value === chosen,
      named = open && item.number !== null;
    el.pgraphItem = item;
    el.classList.toggle("chosen", open);
    title.setAttribute("aria-pressed", open);
    title.firstChild.textContent = named ? "" : item.name;
    title.lastChild.textContent = item.length;
    name.hidden = out.hidden = !named;
    if (named) cells.set(name, item.name);
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector),
      scenario = data.id;
    pgraph.keyed($(".listed"), data.scenarios, one, (el, item) => fillOne(el, item, data.name));
    $(".none").hidden = !data.none;
    $(".some").hidden = data.none;
    const ask = {
      edit: (field, entries, serial) => send("EditScenario", { serial, scenario, field, entries }),
      press: (event, fields) => send(event, { scenario, ...fields }),
    };
    forms.draw($(".settings-form"), data.form, ask, String(scenario));
    forms.draw($(".start-form"), data.start, ask, String(scenario));
    forms.draw($(".active-form"), data.active, ask, String(scenario));
    $(".going").hidden = !data.switches.length;
    pgraph.keyed($(".going .rows"), ofScenario(data, data.switches), line, fill);
    $(".drives").hidden = !data.drives.length;
    pgraph.keyed($(".drives .rows"), ofScenario(data, data.drives), drive, fillDrive);
  }

  // Rows of another scenario are others, whatever their numbers.
  const ofScenario = (data, items) =>
    items.map((item) => ({
      ...item,
      number: item.id,
      scenario: data.id,
      id: `${data.id} ${item.id}`,
    }));

  // -- switches: a form each -----------------------------------------------------------------------------
  function line() {
    const el = make("div", { className: "switch" }),
      where = () => ({ number: el.pgraphItem.number, scenario: el.pgraphItem.scenario });
    const edit = (field, entries, serial) =>
      send("EditSwitch", { serial, ...where(), field, entries });
    el.pgraphSwitch = {
      edit,
      owner: { part: "switches", name: "" },
      press: (event) => send(event, where()),
    };
    return el;
  }
  function fill(el, item) {
    el.pgraphItem = item;
    forms.draw(el, item.form, el.pgraphSwitch, String(item.id));
  }

  // -- forces -------------------------------------------------------------------------------------
  function drive(item) {
    const el = make("div", { className: "tie" });
    const open = (on) => {
      el.classList.toggle("open", on);
      el.querySelector(".form").hidden = !on;
      el.querySelector(".title").setAttribute("aria-expanded", String(on));
      if (on) pgraph.beforePicture("drive", () => el.scrollIntoView({ block: "nearest" }));
    };
    el.append(
      make(
        "div",
        { className: "line" },
        make(
          "button",
          { className: "title", onclick: () => open(!el.classList.contains("open")) },
          make("strong"),
          make("span", { className: "between" }),
          make("span", { className: "kind" }),
        ),
        button("delete-tie", "×", "Delete", () =>
          send("DeleteDrive", { name: el.dataset.name, scenario: item.scenario }),
        ),
      ),
      make("div", { className: "form" }),
    );
    open(adding === item.scenario); // it is there to be set; the forces of another scenario stay closed
    adding = null;
    return el;
  }
  function fillDrive(el, item) {
    for (const [part, value] of [
      ["strong", item.name],
      [".between", item.between],
      [".kind", item.kind],
    ])
      el.querySelector(part).textContent = value;
    el.querySelector(".title").title = [item.name, item.between].filter(Boolean).join(", ");
    const edit = (field, entries, serial) =>
      send("EditDrive", { serial, scenario: item.scenario, name: el.dataset.name, field, entries });
    forms.draw(
      el.querySelector(".form"),
      item.form,
      { edit, owner: { part: "forces", name: item.name } },
      "drive",
    );
  }

  // -- what happened in the run, in the order of time. A click looks there ---------------------------------
  function log(host, events) {
    if (!events.length) {
      host.replaceChildren(
        text("p", "muted", "No constraint or contact went on or off in this run."),
      );
      return;
    }
    const look = (event) => {
      if (event) send("Scrub", { time: event.t });
    };
    const line = (event) =>
      make(
        "li",
        {
          className: "fall",
          role: "option",
          title: `${event.before} to ${event.after}; ${event.cause}`,
          onclick: () => look(event),
        },
        text("span", "t", event.t.toFixed(4)),
        text("span", "part", event.part),
        text("span", "", event.after),
      );
    const onkeydown = (event) => {
      const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (by) {
        event.preventDefault();
        look(events[host.pgraphShown + by]);
      }
    };
    host.pgraphShown = null;
    const head = make(
      "div",
      { className: "fall head" },
      ...["Time s", "Where", "What"].map((one) => text("span", one === "Time s" ? "t" : "", one)),
    );
    host.replaceChildren(
      head,
      make(
        "ol",
        { className: "falls", role: "listbox", tabIndex: 0, "aria-label": "events", onkeydown },
        ...events.map(line),
      ),
    );
    follow(host);
  }
  // The last event so far is marked and in sight, and those to come are fainter.
  function follow(host) {
    const [now] = pgraph.latest.time ?? pgraph.latest.playback?.moment ?? [0],
      lines = host.querySelectorAll("li");
    const at = (pgraph.latest.events ?? []).findLastIndex(({ t }) => t <= now + 1e-9);
    if (at === host.pgraphShown || !lines.length) return;
    host.pgraphShown = at;
    lines.forEach((line, i) => {
      line.setAttribute("aria-selected", i === at);
      line.classList.toggle("ahead", i > at);
    });
    lines[Math.max(at, 0)].scrollIntoView({ block: "nearest" });
  }

  pgraph.view("scenario", { build, scenario: draw });
  pgraph.view("events", {
    build: (host) => pgraph.inSight(host, "events"),
    events: log,
    time: follow,
    playback: follow,
  });
})();

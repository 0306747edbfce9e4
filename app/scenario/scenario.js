// The scenario that is chosen for the run: how it starts, what acts in it, what goes on and off when.
(() => {
  const { make, button, text, cells, forms, send } = pgraph;
  let adding = null; // the scenario that was asked for one more force
  const now = () => pgraph.latest.scenario?.id ?? null; // the one that is shown

  function build(host) {
    const scenario = cells.choice(() => pgraph.latest.scenario.scenarios, (serial, value) => send("SetScenario", { serial, scenario: value }), { label: "scenario to edit" });
    host.pgraphScenario = { scenario };
    host.replaceChildren(make("div", { className: "scenario" },
      make("div", { className: "bar" }, scenario,
        button("new-scenario", "+ New", "A scenario that runs as the run is set now", () => send("NewScenario")),
        button("copy-scenario", "Copy", "This scenario once more", () => send("CopyScenario", { scenario: now() })),
        button("delete-scenario", "Delete", "The model without this scenario", () => send("DeleteScenario", { scenario: now() }))),
      make("p", { className: "muted none", textContent: "A free run has no scenario. A scenario keeps a run with the model: its initial state, the forces that act, and when constraints switch on or off." }),
      make("div", { className: "some" },
        make("div", { className: "settings-form" }), button("small run-settings", "Run settings", "Method, duration, step and tolerance, which the scenario may keep", () => document.querySelector("button.method").click()),
        make("section", { className: "going" }, make("h4", { textContent: "Switches" }), text("div", "empty"), text("div", "rows"),
          button("small add-switch", "+ Switch", "Switches a constraint on or off: at a time, or when something crosses a value", () => send("AddSwitch", { constraint: null }))),
        make("div", { className: "start-form" }),
        make("div", { className: "poses" },
          button("small take-pose", "Take the pose shown", "The pose and the speeds that are shown become the initial state of this scenario", () => send("TakePose", { scenario: now(), shown: true })),
          button("small no-pose", "As the model", "The scenario starts as the model says", () => send("TakePose", { scenario: now(), shown: false }))),
        make("div", { className: "active-form" }),
        make("section", { className: "drives" }, make("h4", { textContent: "Forces and motors" }), text("div", "empty"), text("div", "rows"), drive()))));
    pgraph.inSight(host, "scenario");
  }

  // Which force, on which body: added to the scenario alone.
  function drive() {
    const kind = make("select", { className: "cell", "aria-label": "kind of force" }), body = make("select", { className: "cell", "aria-label": "body of the force" });
    const options = (box, known) => { const now = box.value; box.replaceChildren(...known.map(([value, textContent, title]) => make("option", { value, textContent, title: title ?? "" }))); box.value = known.some(([value]) => value === now) ? now : known[0]?.[0] ?? ""; };
    const fill = () => {
      options(kind, (pgraph.latest.scenario.kinds ?? []).map(([name, about]) => [name, name, about]));
      options(body, (pgraph.latest.table?.rows ?? []).map((row) => [row.name, row.name]));
    };
    for (const box of [kind, body]) { box.addEventListener("mousedown", fill); box.addEventListener("focus", fill); }
    const box = make("div", { className: "field add-drive" }, make("span", { className: "muted", textContent: "+" }), kind, make("span", { className: "muted", textContent: "on" }), body,
      button("small", "Add", "Acts in this scenario only", () => { adding = now(); send("AddDrive", { scenario: now(), kind: kind.value, body: body.value }); }));
    box.pgraphFill = fill;
    return box;
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    cells.choose(host.pgraphScenario.scenario, data.name);
    $(".none").hidden = !data.none;
    $(".some").hidden = data.none;
    $(".copy-scenario").disabled = $(".delete-scenario").disabled = data.none;
    const scenario = data.id;
    const ask = {
      edit: (field, entries, serial) => send("EditScenario", { serial, scenario, field, entries }),
      press: (b) => send("EditScenario", { serial: pgraph.nextSerial(), scenario, field: b.fields.field, entries: [[b.fields.index, b.fields.text]] }),
    };
    forms.draw($(".settings-form"), data.form, ask, String(scenario));
    forms.draw($(".start-form"), data.start.slice(0, 1), ask, String(scenario));
    forms.draw($(".active-form"), data.start.slice(1), ask, String(scenario));
    $(".add-drive").pgraphFill();
    switches($(".going"), data);
    drives($(".drives"), data);
  }

  // -- switches: a form each -----------------------------------------------------------------------------
  function switches(box, data) {
    const empty = box.querySelector(".empty"), add = box.querySelector(".add-switch");
    empty.textContent = data.switchable.length ? "nothing is switched during the run" : "there is no constraint to switch";
    empty.hidden = data.switches.length > 0;
    add.disabled = !data.switchable.length;
    pgraph.keyed(box.querySelector(".rows"), ofScenario(data, data.switches), line, fill);
  }

  // Rows of another scenario are others, whatever their numbers.
  const ofScenario = (data, items) => items.map((item) => ({ ...item, number: item.id, scenario: data.id, id: `${data.id} ${item.id}` }));

  function line() {
    const el = make("div", { className: "switch" }), where = () => ({ number: el.pgraphItem.number, scenario: el.pgraphItem.scenario });
    const edit = (field, entries, serial) => send("EditSwitch", { serial, ...where(), field, entries });
    el.pgraphSwitch = { edit, owner: { part: "switches", name: "" }, press: (b) => (b.event ? send(b.event, where()) : edit(b.fields.field, [[b.fields.index, b.fields.text]], pgraph.nextSerial())) };
    return el;
  }
  function fill(el, item) {
    el.pgraphItem = item;
    forms.draw(el, item.form, el.pgraphSwitch, String(item.id));
  }

  // -- forces -------------------------------------------------------------------------------------
  function drives(box, data) {
    const empty = box.querySelector(".empty");
    empty.textContent = "none besides those of the model";
    empty.hidden = data.drives.length > 0;
    pgraph.keyed(box.querySelector(".rows"), ofScenario(data, data.drives), (item) => {
      const el = make("div", { className: "tie" });
      const open = (on) => { el.classList.toggle("open", on); el.querySelector(".form").hidden = !on; el.querySelector(".title").setAttribute("aria-expanded", String(on)); if (on) pgraph.beforePicture("drive", () => el.scrollIntoView({ block: "nearest" })); };
      el.append(make("div", { className: "line" }, make("button", { className: "title", onclick: () => open(!el.classList.contains("open")) }, make("strong"), make("span", { className: "between" }), make("span", { className: "kind" })),
        button("small delete-tie", "×", "Delete", () => send("DeleteDrive", { name: el.dataset.name, scenario: data.id }))), make("div", { className: "form" }));
      open(adding === data.id); // it is there to be set; the forces of another scenario stay closed
      adding = null;
      return el;
    }, (el, item) => {
      for (const [part, value] of [["strong", item.name], [".between", item.between], [".kind", item.kind]]) el.querySelector(part).textContent = value;
      el.querySelector(".title").title = [item.name, item.between].filter(Boolean).join(", ");
      const edit = (field, entries, serial) => send("EditDrive", { serial, scenario: item.scenario, name: el.dataset.name, field, entries });
      forms.draw(el.querySelector(".form"), item.form, { edit, owner: { part: "forces", name: item.name }, press: (b) => edit(b.fields.field, [[b.fields.index, b.fields.text]], pgraph.nextSerial()) }, "drive");
    });
  }

  // -- what happened in the run; a click looks there ------------------------------------------------
  function log(host, events) {
    pgraph.frame.count("Events", events.length);
    if (!events.length) { host.replaceChildren(text("p", "muted", "No constraint or contact went on or off in this run.")); return; }
    host.replaceChildren(make("ol", { className: "falls" }, ...events.map(({ t, text: said, cause }) => make("li", {},
      make("button", { className: "fall", title: cause || "Look there", onclick: () => send("Scrub", { time: t }) },
        text("span", "t", t.toFixed(4)), text("span", "foot", said), text("span", "now", cause))))));
  }

  pgraph.view("scenario", { build, scenario: draw });
  pgraph.view("events", { build: (host) => pgraph.inSight(host, "events"), events: log });
})();

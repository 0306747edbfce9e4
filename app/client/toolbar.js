// The model (new, open, save, undo), the run (what to simulate, progress, outcome), what is shown.
(() => {
  const { make, cells, send } = pgraph;
  const SHOW = [
    ["axes", "joint axes"], ["links", "link vectors"], ["coms", "centres of mass"],
    ["names", "names"], ["forces", "constraint forces"],
  ];
  const LARGEST_FILE = 8_000_000; // [bytes]
  const text = (tag, className, textContent = "") => make(tag, { className, textContent });
  const button = (className, textContent, title, onclick) =>
    make("button", { className: `action ${className}`, textContent, title, onclick });
  function picture(className, title, onclick) {
    const made = button(className, "", title, onclick);
    made.setAttribute("aria-label", title);
    made.append(pgraph.icon(className));
    return made;
  }

  function build(host) {
    host.replaceChildren(
      make("div", { className: "bar" },
        button("new", "New", "A new model: how many bodies?", () => ask(host, newQuestion)),
        button("open", "Open", "A built-in model or a file", () => ask(host, openQuestion)),
        button("save", "Save", "Download, or write to a file", () => ask(host, saveQuestion)),
        text("span", "spring"),
        picture("undo", "Undo", () => send("Undo")),
        picture("redo", "Redo", () => send("Redo")),
        picture("theme", "Dark or light", () => send("Theme", { dark: !pgraph.latest.theme?.dark }))),
      make("div", { className: "asked" }),
      make("div", { className: "model" }, text("strong", "name"), text("span", "muted count")),
      make("div", { className: "kernels", hidden: true }, text("span", "said"), make("progress", { max: 1 })),
      run(host),
      make("fieldset", { className: "show" }, make("legend", { textContent: "Show" }), ...SHOW.map(([what, label]) =>
        make("label", {}, make("input", {
          type: "checkbox", "data-what": what,
          onchange: (event) => send("Show", { what, on: event.target.checked }),
        }), label))));
  }

  function run(host) {
    const edit = (field) => (serial, value) => send("SetRun", { serial, field, text: value });
    const scenario = cells.choice(() => pgraph.latest.toolbar.scenarios, (serial, value) => send("SetScenario", { serial, scenario: value }), { label: "scenario" });
    const method = cells.choice(() => pgraph.latest.toolbar.methods, edit("method"), { label: "method" });
    const t_end = cells.input(edit("t_end"), { label: "duration", numeric: true });
    const step = cells.input(edit("step"), { label: "step", numeric: true });
    host.pgraphRun = { scenario, method, t_end, step };
    const field = (label, unit, cell) => make("div", { className: unit ? "field" : "field wide" },
      make("div", { className: "what" }, make("span", { textContent: label }), text("span", "unit", unit)), cell);
    return make("fieldset", { className: "run" }, make("legend", { textContent: "Simulate" }),
      make("div", { className: "settings" }, field("Scenario", "", scenario), field("Method", "", method),
        field("Duration", "s", t_end), field("Step", "s", step)),
      button("primary simulate", "Simulate", "Run in the background", () => { document.activeElement?.blur(); send("Simulate"); }),
      make("div", { className: "job", hidden: true }, make("progress", { max: 1 }), text("span", "said"),
        button("cancel", "Cancel", "Stop the simulation", () => send("Cancel"))),
      make("div", { className: "problem sentence", hidden: true }), make("dl", { className: "summary", hidden: true }));
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    $(".model .name").textContent = data.name;
    $(".model .count").textContent = data.count;
    for (const which of ["undo", "redo"]) {
      $(`.${which}`).disabled = data[which] === null;
      const key = which === "undo" ? "Ctrl+Z" : "Ctrl+Shift+Z", word = which === "undo" ? "Undo" : "Redo";
      $(`.${which}`).title = data[which] === null ? `Nothing to ${which}` : `${word}: ${data[which]} (${key})`;
    }
    const { scenario, method, t_end, step } = host.pgraphRun;
    cells.choose(scenario, data.request.scenario);
    cells.choose(method, data.request.method);
    cells.set(t_end, data.request.t_end);
    cells.set(step, data.request.step);
    $(".kernels").hidden = data.kernels === null;
    if (data.kernels) {
      $(".kernels .said").textContent = data.kernels.text;
      progress($(".kernels progress"), data.kernels.fraction);
    }
    for (const box of host.querySelectorAll("[data-what]")) box.checked = data.shown.includes(box.dataset.what);
    job(host, data);
  }

  function job(host, data) {
    const $ = (selector) => host.querySelector(selector);
    $(".simulate").hidden = data.job !== null;
    $(".job").hidden = data.job === null;
    if (data.job) {
      progress($(".job progress"), data.job.fraction);
      $(".job .said").textContent = data.job.text;
    }
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    const summary = $(".summary");
    summary.hidden = data.summary === null;
    const lines = (data.summary ?? []).flatMap(([what, value, good]) => [
      make("dt", { textContent: what }), make("dd", { textContent: value, className: good ? "" : "bad" })]);
    summary.replaceChildren(...lines);
  }
  function progress(bar, fraction) {
    bar.hidden = fraction !== null && fraction < 0;
    if (fraction === null) bar.removeAttribute("value");
    else bar.value = fraction;
  }

  // -- one question at a time, below the buttons -----------------------------------------------
  function ask(host, question) {
    const box = host.querySelector(".asked"), again = box.dataset.asked === question.name;
    box.replaceChildren();
    box.dataset.asked = "";
    if (again) return;
    box.dataset.asked = question.name;
    const close = () => { box.replaceChildren(); box.dataset.asked = ""; };
    box.append(...question(close));
    box.querySelector("input[type=text]")?.focus();
    box.onkeydown = (event) => { if (event.key === "Escape") close(); };
  }

  function newQuestion(close) {
    return typed("How many bodies?", "4", "Create", close, (serial, bodies) => send("NewModel", { serial, bodies }));
  }

  function saveQuestion(close) {
    const download = button("primary download", "Download as a file", "JSON", () => { send("Download"); close(); });
    const path = `${pgraph.latest.toolbar.name.replace(/[^\w-]+/g, "_")}.json`;
    const save = (serial, typedPath) => send("Save", { serial, path: typedPath });
    return [make("div", { className: "ask" }, download), ...typed("or on this computer as", path, "Save", close, save)];
  }

  // A question with one typed answer, given by Enter or the button; a refused one stays.
  function typed(question, suggestion, verb, close, act) {
    const cell = cells.input(act, { label: question, leaving: false });
    cell.dataset.shown = "";
    cell.value = suggestion;
    cell.onaccept = close;
    const go = button("primary go", verb, "", () => cells.commit(cell, act));
    return [make("div", { className: "ask" }, make("span", { textContent: question }), cell, go)];
  }

  function openQuestion(close) {
    const file = make("input", { type: "file", accept: ".json,application/json", hidden: true });
    file.onchange = () => read(file.files[0], close);
    const list = pgraph.latest.toolbar.gallery.map(([name, what]) => make("button", {
      className: "item", "data-model": name, onclick: () => { send("OpenBuiltIn", { name }); close(); },
    }, make("strong", { textContent: name }), make("span", { className: "muted", textContent: what })));
    return [make("div", { className: "gallery" }, ...list),
      make("div", { className: "ask" }, button("file", "Open a file …", "A model saved as JSON", () => file.click()), file)];
  }

  async function read(file, close) {
    if (!file) return;
    if (file.size > LARGEST_FILE) { pgraph.toast(`${file.name} has ${(file.size / 1e6).toFixed(1)} MB; a model file has at most 8 MB.`); return; }
    send("OpenText", { name: file.name, content: await file.text() });
    close();
  }

  pgraph.view("toolbar", { build, toolbar: draw });
})();

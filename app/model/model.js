// The model: new, open, save, undo.
(() => {
  const { make, button, text, cells, send } = pgraph;

  function build(host) {
    host.replaceChildren(
      make("div", { className: "bar file" },
        button("new", "New", "A new model: how many bodies?", () => ask(host, newQuestion)),
        button("open", "Open", "A built-in model or a file", () => ask(host, openQuestion)),
        button("save", "Save", "Download, or write to a file", () => ask(host, saveQuestion)),
        text("span", "spring"),
        make("span", { className: "group" },
          pgraph.pictureButton("undo", "undo", "Undo", "Undo", () => send("Undo")),
          pgraph.pictureButton("redo", "redo", "Redo", "Redo", () => send("Redo")),
          pgraph.pictureButton("theme", "theme", "Dark or light", "Dark or light", () => send("Theme", { dark: !pgraph.latest.theme?.dark })),
          button("keys", "?", "Keyboard shortcuts (?)", () => pgraph.shortcuts.open()))),
      make("div", { className: "reading", hidden: true }, text("span", "what"), button("small cancel", "Cancel", "Stop reading this file", () => send("CancelReading"))),
      make("div", { className: "asked" }),
      make("div", { className: "model" }, text("strong", "name"), text("span", "muted count")));
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    $(".model .name").textContent = $(".model .name").title = data.name;
    $(".model .count").textContent = data.count;
    $(".reading").hidden = data.reading === null;
    $(".reading .what").textContent = `Reading ${data.reading ?? ""} …`;
    for (const which of ["undo", "redo"]) {
      $(`.${which}`).disabled = data[which] === null;
      const key = which === "undo" ? "Ctrl+Z" : "Ctrl+Shift+Z", word = which === "undo" ? "Undo" : "Redo";
      $(`.${which}`).title = data[which] === null ? `Nothing to ${which}` : `${word}: ${data[which]} (${key})`;
    }
  }

  // Keys: save where it was saved last, or ask where; open; the palette of commands runs these too.
  const press = (which) => document.querySelector(`.pgraph button.${which}`)?.click();
  pgraph.commands = {
    new: () => press("new"), open: () => press("open"), save: () => press("save"), keys: () => pgraph.shortcuts.open(),
    theme: () => press("theme"), simulate: () => press("simulate"), live: () => press("action.live"), undo: () => send("Undo"), redo: () => send("Redo"),
    play: () => pgraph.play(), find: () => { const box = document.querySelector(".pgraph .search"); box?.focus(); box?.select(); },
    add: () => press("add"), download: () => send("Download"), tour: () => pgraph.tour?.start(), measure: () => pgraph.camera.measure(),
  };
  pgraph.on("command", ({ run }) => {
    const [kind, what] = run.split(":");
    if (kind === "tab") pgraph.front(what);
    else if (kind === "model") send("OpenBuiltIn", { name: what });
    else if (kind === "view") pgraph.camera.look(what);
    else pgraph.commands[kind]?.();
  });
  window.addEventListener("keydown", (event) => {
    const which = { s: "save", o: "open", f: "find" }[event.key.toLowerCase()];
    if (!which || !(event.ctrlKey || event.metaKey) || event.shiftKey || event.altKey) return;
    event.preventDefault(); // the browser's own save, open and find
    pgraph.commands[which]();
  }, true);

  // -- one question at a time: below the buttons, or with a heading over the 3D view ---------------
  const OVER = { newQuestion: "New model", openQuestion: "Open a model" };
  function ask(host, question) {
    const box = host.querySelector(".asked"), again = box.dataset.asked === question.name;
    const close = () => {
      box.replaceChildren();
      box.dataset.asked = "";
      for (const name of ["role", "aria-label"]) box.removeAttribute(name);
    };
    close();
    if (again) return;
    box.dataset.asked = question.name;
    const title = OVER[question.name];
    if (title) {
      box.setAttribute("role", "dialog");
      box.setAttribute("aria-label", title);
      box.append(make("h3", { textContent: title }));
    }
    box.append(...question(close));
    if (title) box.append(make("button", { className: "close", textContent: "×", title: "Close (Esc)", "aria-label": "close", onclick: close }));
    box.querySelector("input[type=text], button")?.focus(); // where Escape is heard
    box.onkeydown = (event) => { if (event.key === "Escape") close(); };
  }

  function newQuestion(close) {
    const asked = typed("How many bodies?", "4", "Create", close, (serial, bodies) => send("NewModel", { serial, bodies })), cell = asked[0].querySelector("input");
    cell.addEventListener("paste", (event) => {
      const text = event.clipboardData.getData("text/plain").trimEnd();
      if (!/[\t\n\r]/.test(text)) return;
      event.preventDefault();
      cells.await(cell, (serial) => send("NewFromLines", { serial, text }));
    });
    return [...asked, make("div", { className: "muted", textContent: "or paste rows of a spreadsheet here (Ctrl+V), or start from one of these" }), gallery(close, [])];
  }

  function saveQuestion(close) {
    const download = button("primary download", "Download as a file", "JSON; with mesh files a zip of that and them", () => { send("Download"); close(); });
    const file = (name) => `${name.replace(/[^\w-]+/g, "_")}.json`, { name, unnamed } = pgraph.latest.toolbar, path = file(name);
    const save = (serial, typedPath, replace = false) => send("Save", { serial, path: typedPath, replace });
    const anyway = (typedPath) => (serial) => save(serial, typedPath, true);
    const others = [[".urdf", "URDF"], [".xml", "MJCF"]].map(([suffix, name]) =>
      button(`download${suffix.replace(".", "-")}`, name, `Download as ${name}; with mesh files a zip of that and them`, () => { send("Download", { suffix }); close(); }));
    const where = typed("or in the folder in which Pgraph was started, as", path, "Save", close, save, anyway);
    return [...unnamed ? [naming(name, (given) => { where[0].querySelector("input").value = file(given); })] : [],
      make("div", { className: "ask" }, download, ...others), ...where];
  }

  // A model that nobody has named yet is given a name when it is saved, which its files then have.
  function naming(name, taken) {
    const cell = cells.input((serial, text) => send("EditWorld", { serial, field: "name", entries: [[[], text]] }), { label: "name of the model" });
    cells.set(cell, name);
    cell.onaccept = () => taken(cell.dataset.sent);
    return make("div", { className: "ask" }, make("span", { textContent: "Name" }), cell);
  }

  // A question with one typed answer, given by Enter or the button; a refused one stays, with what
  // Python offers to do with it.
  function typed(question, suggestion, verb, close, act, offered) {
    const cell = cells.input(act, { label: question, leaving: false });
    cell.dataset.shown = "";
    cell.value = suggestion;
    cell.style.minWidth = `${Math.min(suggestion.length, 26) + 2}ch`;
    cell.onaccept = close;
    cell.onrefuse = (offer, note) => {
      if (offer && note) note.append(" ", button("small offer", offer, "", () => cells.await(cell, offered(cell.value))));
    };
    const go = button(verb === "Save" ? "go" : "primary go", verb, "", () => cells.commit(cell, act));
    return [make("div", { className: "ask" }, make("span", { textContent: question }), cell, go)];
  }

  function openQuestion(close) {
    const file = make("input", { type: "file", accept: ".json,.zip,.urdf,.xml,.mjcf,application/json,application/zip", hidden: true });
    file.onchange = () => { pgraph.files.read(file.files[0]); close(); };
    return [make("div", { className: "ask" }, button("file", "Open a file …", "A model saved as JSON, a URDF or MJCF file, or a zip of one with its meshes; it can also be dropped on the page", () => file.click()), file),
      gallery(close, pgraph.latest.toolbar.kept)];
  }

  // Cards with a picture and a sentence each; the pictures come a moment later.
  function gallery(close, kept) {
    const card = (event) => ([name, what]) => make("button", {
      className: "item", "data-model": name, title: what, onclick: () => { send(event, { name }); close(); },
    }, make("span", { className: "picture" }), make("strong", { textContent: name.replaceAll("_", " ") }), make("span", { className: "muted", textContent: what }));
    const left = (one) => {
      const discard = button("small", "Discard", `Delete ${one[0]}`, () => { send("DiscardKept", { name: one[0] }); both.remove(); });
      const both = make("div", { className: "left" }, card("OpenKept")(one), discard);
      return both;
    };
    send("ShowGallery");
    const box = make("div", { className: "gallery" }, ...kept.map(left), ...pgraph.latest.toolbar.gallery.map(card("OpenBuiltIn")));
    if (pgraph.latest.pictures) pictures(box, pgraph.latest.pictures);
    return box;
  }
  function pictures(box, drawn) {
    for (const item of box.querySelectorAll(".item")) item.querySelector(".picture").innerHTML = drawn[item.dataset.model] ?? "";
  }
  pgraph.on("pictures", (drawn) => document.querySelectorAll(".pgraph .gallery").forEach((box) => pictures(box, drawn)));

  pgraph.view("toolbar", { build, toolbar: draw });
})();

// The model: new, open, save, undo.
(() => {
  const { make, button, text, cells, send } = pgraph;

  const CARRIES =
    "A link that carries the model: any page of Pgraph opens it, and no server gets it";

  function build(host) {
    const name = make(
      "button",
      { className: "bare model-menu", "aria-label": "model" },
      text("span", "name"),
      pgraph.icon("down", 12),
    );
    pgraph.menuButton(name, "model", () => [
      [
        "New …",
        "",
        () => ask(newQuestion),
        { className: "new", about: "A new model: how many bodies, or from an example" },
      ],
      [
        "Open …",
        "Ctrl O",
        () => ask(openQuestion),
        { className: "open", about: "An example or a file" },
      ],
      [
        "Save …",
        "Ctrl S",
        () => ask(saveQuestion),
        { className: "save", about: "Download, or write to a file" },
      ],
      null,
      [
        "Download",
        "",
        () => send("Download"),
        { about: "JSON; with mesh files a zip of that and them" },
      ],
      ["Copy link", "", () => send("ShareLink"), { className: "share", about: CARRIES }],
    ]);
    const search = make(
      "button",
      {
        className: "search-all",
        title: "Search bodies and commands (Ctrl K)",
        onclick: () => pgraph.palette.open(),
      },
      pgraph.icon("search"),
      text("span", "", "Search bodies and commands"),
      text("kbd", "", "Ctrl K"),
    );
    host.replaceChildren(
      pgraph.pictureButton("bare sheet-toggle", "left", "model panel", "Model (Ctrl B)", () =>
        pgraph.frame.toggle("left"),
      ),
      make("span", { className: "brand" }, mark(), "Pgraph"),
      text("span", "rule"),
      name,
      text("span", "muted count"),
      text("span", "rule"),
      pgraph.pictureButton("bare undo", "undo", "Undo", "Undo", () => send("Undo")),
      pgraph.pictureButton("bare redo", "redo", "Redo", "Redo", () => send("Redo")),
      make(
        "span",
        { className: "reading", hidden: true },
        text("span", "what"),
        button("cancel", "Cancel", "Stop reading this file", () => send("CancelReading")),
      ),
      text("span", "spring"),
      search,
    );
  }
  // A tree of three nodes: the sign of the program.
  function mark() {
    const box = make("span", { className: "mark" });
    box.innerHTML =
      '<svg width="20" height="20" viewBox="0 0 20 20" fill="none" stroke="currentColor" stroke-width="1.6" stroke-linecap="round"><path d="M10 7.7c0 3-5 2-5 5.3M10 7.7c0 3 5 2 5 5.3M10 6v1.7"/><circle cx="10" cy="4" r="2.4" fill="currentColor"/><circle cx="5" cy="15" r="2.4"/><circle cx="15" cy="15" r="2.4"/></svg>';
    return box;
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    $(".name").textContent = $(".name").title = data.name;
    $(".count").textContent = [data.count, ...(data.unsaved ? ["edited"] : [])].join(" · ");
    for (const [tab, n] of Object.entries(data.counts)) pgraph.frame.count(tab, n);
    $(".reading").hidden = data.reading === null;
    $(".reading .what").textContent = `Reading ${data.reading ?? ""} …`;
    for (const [which, word, key] of [
      ["undo", "Undo", "Ctrl+Z"],
      ["redo", "Redo", "Ctrl+Shift+Z"],
    ]) {
      $(`.${which}`).disabled = data[which] === null;
      $(`.${which}`).title =
        data[which] === null ? `Nothing to ${which}` : `${word}: ${data[which]} (${key})`;
    }
  }

  pgraph.commands("Model", () => [
    ["New model", "", () => ask(newQuestion), "how many bodies, or from an example"],
    ["Open a model", "Ctrl O", () => ask(openQuestion)],
    ["Save the model", "Ctrl S", () => ask(saveQuestion)],
    ["Download the model", "", () => send("Download"), "as one file"],
    ["Copy a link to the model", "", () => send("ShareLink"), CARRIES],
    ["Undo", "Ctrl Z", () => send("Undo")],
    ["Redo", "Ctrl Shift Z", () => send("Redo")],
  ]);
  pgraph.commands("Examples", () =>
    (pgraph.latest.toolbar?.gallery ?? []).map(([name, what]) => [
      `Open ${name}`,
      "",
      () => send("OpenBuiltIn", { name }),
      what,
    ]),
  );
  window.addEventListener(
    "keydown",
    (event) => {
      const asked = { s: saveQuestion, o: openQuestion }[event.key.toLowerCase()];
      if (!asked || !(event.ctrlKey || event.metaKey) || event.shiftKey || event.altKey) return;
      event.preventDefault(); // the browser's own save and open
      ask(asked);
    },
    true,
  );

  // -- links: the model is their fragment, which the browser keeps to itself -------------------------
  pgraph.on("link", ({ fragment, safe }) => {
    const link = `${location.origin}${location.pathname}${fragment}`,
      long = link.length > safe ? ` Many programs cut links above ${safe}: send a file there.` : "";
    const copied = () => pgraph.toast(`Copied a link of ${link.length} characters.${long}`, true);
    const shown = () => {
      const box = pgraph.dialog("A link to the model", "asked"),
        field = make("input", { type: "text", value: link, readOnly: true });
      box.lastChild.append(field);
      field.select();
    };
    if (navigator.clipboard) navigator.clipboard.writeText(link).then(copied, shown);
    else shown(); // not to be had at addresses without https but for this computer
  });
  function openLink() {
    if (!location.hash.startsWith("#m=")) return;
    send("OpenLink", { link: location.hash });
    history.replaceState(null, "", location.pathname + location.search); // not again on a reload
  }
  window.addEventListener("hashchange", openLink);
  pgraph.on("toolbar", openLink);

  // -- one question at a time ------------------------------------------------------------------------
  const TITLES = {
    newQuestion: "New model",
    openQuestion: "Open a model",
    saveQuestion: "Save the model",
  };
  function ask(question) {
    if (document.querySelector("dialog:modal")) return;
    const box = pgraph.dialog(TITLES[question.name], "asked");
    box.dataset.asked = question.name;
    box.lastChild.append(...question(() => box.close()));
    box.lastChild.querySelector("input[type=text], button")?.focus();
  }

  function newQuestion(close) {
    // its bodies come to the front: a tab of connections would be empty
    const made = () => {
      close();
      pgraph.front("Bodies");
    };
    const asked = typed("How many bodies?", "4", "Create", made, (serial, bodies) =>
        send("NewModel", { serial, bodies }),
      ),
      cell = asked[0].querySelector("input");
    cell.addEventListener("paste", (event) => {
      const text = event.clipboardData.getData("text/plain").trimEnd();
      if (!/[\t\n\r]/.test(text)) return;
      event.preventDefault();
      cells.await(cell, (serial) => send("Paste", { serial, text, afresh: true }));
    });
    return [
      ...asked,
      make("div", {
        className: "muted",
        textContent: "or paste rows of a spreadsheet here (Ctrl+V), or start from one of these",
      }),
      gallery(close, []),
    ];
  }

  function saveQuestion(close) {
    const download = button(
      "primary download",
      "Download as a file",
      "JSON; with mesh files a zip of that and them",
      () => {
        send("Download");
        close();
      },
    );
    const file = (name) => `${name.replace(/[^\w-]+/g, "_")}.json`,
      { name, unnamed } = pgraph.latest.toolbar,
      path = file(name);
    const save = (serial, typedPath, replace = false) =>
      send("Save", { serial, path: typedPath, replace });
    const anyway = (typedPath) => (serial) => save(serial, typedPath, true);
    const others = pgraph.latest.toolbar.formats.map(([suffix, name]) =>
      button(
        `download${suffix.replace(".", "-")}`,
        name,
        `Download as ${name}; with mesh files a zip of that and them`,
        () => {
          send("Download", { suffix });
          close();
        },
      ),
    );
    const where = typed(
      "or in the folder in which Pgraph was started, as",
      path,
      "Save",
      close,
      save,
      anyway,
    );
    return [
      ...(unnamed
        ? [
            naming(name, (given) => {
              where[0].querySelector("input").value = file(given);
            }),
          ]
        : []),
      make("div", { className: "ask" }, download, ...others),
      ...where,
    ];
  }

  // A model that nobody has named yet is given a name when it is saved, which its files then have.
  function naming(name, taken) {
    const cell = cells.input(
      (serial, text) => send("EditWorld", { serial, field: "name", entries: [[[], text]] }),
      { label: "name of the model" },
    );
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
      if (offer && note)
        note.append(
          " ",
          button("offer", offer, "", () => cells.await(cell, offered(cell.value))),
        );
    };
    const go = button(verb === "Save" ? "go" : "primary go", verb, "", () =>
      cells.commit(cell, act),
    );
    return [make("div", { className: "ask" }, make("span", { textContent: question }), cell, go)];
  }

  // "JSON, URDF or MJCF"
  function models() {
    const names = ["JSON", ...pgraph.latest.toolbar.formats.map(([, name]) => name)];
    return `${names.slice(0, -1).join(", ")} or ${names.at(-1)}`;
  }

  function openQuestion(close) {
    const file = make("input", {
      type: "file",
      accept: [...pgraph.latest.toolbar.opened, "application/json", "application/zip"].join(),
      hidden: true,
    });
    file.onchange = () => {
      pgraph.files.read(file.files[0]);
      close();
    };
    return [
      make(
        "div",
        { className: "ask" },
        button(
          "file",
          "Open a file …",
          `A ${models()} file, or a zip of one with its meshes; it can also be dropped on the page`,
          () => file.click(),
        ),
        file,
      ),
      gallery(close, pgraph.latest.toolbar.kept),
    ];
  }

  // Cards with a picture and a sentence each; the pictures come a moment later.
  function gallery(close, kept) {
    const card =
      (event) =>
      ([name, what]) =>
        make(
          "button",
          {
            className: "item",
            "data-model": name,
            title: what,
            onclick: () => {
              send(event, { name });
              close();
            },
          },
          make("span", { className: "picture" }),
          make("strong", { textContent: name.replaceAll("_", " ") }),
          make("span", { className: "muted", textContent: what }),
        );
    const left = (one) => {
      const discard = button("", "Discard", `Delete ${one[0]}`, () => {
        send("DiscardKept", { name: one[0] });
        both.remove();
      });
      const both = make("div", { className: "left" }, card("OpenKept")(one), discard);
      return both;
    };
    send("ShowGallery");
    const box = make(
      "div",
      { className: "gallery" },
      ...kept.map(left),
      ...pgraph.latest.toolbar.gallery.map(card("OpenBuiltIn")),
    );
    if (pgraph.latest.pictures) pictures(box, pgraph.latest.pictures);
    return box;
  }
  function pictures(box, drawn) {
    for (const item of box.querySelectorAll(".item"))
      item.querySelector(".picture").innerHTML = drawn[item.dataset.model] ?? "";
  }
  pgraph.on("pictures", (drawn) =>
    document.querySelectorAll(".pgraph .gallery").forEach((box) => pictures(box, drawn)),
  );

  // -- an empty model: three ways to begin, in the middle of the view --------------------------------
  function ways(host) {
    const way = (name, about, icon, act) =>
      make(
        "button",
        { className: "item", onclick: act },
        pgraph.icon(icon),
        make("strong", { textContent: name }),
        text("span", "muted", about),
      );
    host.hidden = true;
    host.append(
      make("h2", { textContent: "Start a model" }),
      make(
        "div",
        { className: "ways" },
        way("Add a body", "Then its joint, mass and shape at the right", "add", () =>
          send("AddBody", { parent: null }),
        ),
        way("Paste a table", "Rows of a spreadsheet, or a number of bodies", "duplicate", () =>
          ask(newQuestion),
        ),
        way("Open", "An example, or a file of a model", "folder", () => ask(openQuestion)),
      ),
    );
  }

  pgraph.view("start", {
    build: ways,
    toolbar: (host, data) => {
      host.hidden = data.counts.Bodies > 0;
    },
  });
  pgraph.view("toolbar", { build, toolbar: draw });
})();

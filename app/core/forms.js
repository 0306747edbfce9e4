// Forms: groups of fields of cells. A row is taken whole: cells that were refused are sent again
// with the next one, so that an inertia or a quaternion can be typed number by number.
pgraph.forms = (() => {
  const { make, cells } = pgraph;
  const isDirty = (cell) => cell.value !== cell.dataset.shown;

  // `ask` = {edit(field, entries, serial), check(...), mend(...), press(event, fields), density, upload, parameter}.
  // A row keeps its cells, with what is typed in them, wherever others move it, until `key` is another.
  // If that was `awaited`, what is typed in the cell in focus was meant for it, and stays there.
  function draw(box, groups, ask, key, awaited = false) {
    const folded = (box.pgraphFolded ??= new Map());
    for (const details of box.querySelectorAll(":scope > details"))
      folded.set(details.dataset.title, details.open);
    const focused = box.contains(document.activeElement) ? document.activeElement : null,
      another = box.dataset.key !== key;
    if (another) {
      if (!awaited) cells.leave(box);
      // of something else, with nothing typed in it: its cells are filled anew, which is sooner done
      const typed = [...box.querySelectorAll(".cell")].filter(
        (cell) =>
          cell.matches(".refused, .waiting") || (cell.dataset.shown !== undefined && isDirty(cell)),
      );
      if (awaited && focused) typed.filter((cell) => cell !== focused).forEach(cells.revert);
      else if (typed.length) cells.quietly(() => box.replaceChildren());
      box.dataset.key = key;
    }
    box.pgraphAsk = ask;
    box.style.setProperty("--label", `${widest(groups)}px`);
    const items = groups.map((data) => ({ name: data.title, data }));
    pgraph.keyed(
      box,
      items,
      ({ data }) => group(data, folded),
      (el, { data }) => fillGroup(box, el, data),
    );
    if (
      another &&
      focused?.matches("input.cell") &&
      focused === document.activeElement &&
      !isDirty(focused)
    )
      focused.select();
  }

  // The unit of a row is beside its label, or below it where both are too wide.
  const MOST = 78,
    ruler = document.createElement("canvas").getContext("2d");
  const width = (text, size) => {
    ruler.font = `${size}px ${getComputedStyle(document.body).getPropertyValue("--font")}`;
    return ruler.measureText(text).width;
  };
  const needed = ({ label, unit }) => width(label, 12) + (unit ? width(unit, 11) + 4 : 0);
  const widest = (groups) =>
    Math.ceil(Math.min(MOST, Math.max(76, ...groups.flatMap((one) => one.fields.map(needed)))));

  function group(data, folded) {
    if (!data.title) return make("div");
    return make(
      "details",
      { open: folded.get(data.title) ?? data.open },
      make(
        "summary",
        {},
        make("span"),
        make("span", { className: "unit" }),
        make("span", { className: "state" }),
      ),
      make("div"),
    );
  }
  function fillGroup(box, el, data) {
    if (data.title) {
      el.dataset.title = data.title;
      el.firstChild.firstChild.textContent = data.title;
      el.firstChild.children[1].textContent = data.fields[0]?.heads ? data.fields[0].unit : "";
      el.firstChild.lastChild.textContent = el.firstChild.title = data.state ?? "";
    }
    const seen = new Map();
    const items = data.fields.map((field) => {
      const name = field.field,
        again = seen.get(name) ?? 0;
      seen.set(name, again + 1);
      return { name: again ? `${name} ${again}` : name, field };
    });
    pgraph.keyed(
      data.title ? el.lastChild : el,
      items,
      () => make("div"),
      (row, { field }) => fill(box, row, field),
    );
  }

  function fill(box, el, field) {
    el.pgraphField = field;
    if (el.pgraphKind !== field.kind) {
      cells.leave(el);
      el.replaceChildren(...(field.kind === "parameters" ? parameters(box) : row(box, el)));
      Object.assign(el, { pgraphKind: field.kind, pgraphButtons: "" });
    }
    if (field.kind === "parameters") {
      fillParameters(box, el, field);
      return;
    }
    const grid = el.querySelector(".grid"),
      inputs = cellsOf(box, el, grid, field);
    label(box, el, field);
    buttons(box, el, field);
    if (field.kind === "density") fillDensity(el, String(field.cells[0].value));
    else {
      grid.className = `grid columns-${field.columns}`;
      field.cells.forEach((cell, i) => {
        inputs[i].closest(".grid > *").style.gridColumn = `span ${cell.span ?? 6 / field.columns}`;
        fillCell(inputs[i], field, cell);
      });
    }
  }

  function row(box, el) {
    const field = el.pgraphField,
      what = make("div", { className: "what" }, make("span"), make("span", { className: "unit" }));
    const grid = make("div", { className: "grid" });
    return [
      make("div", { className: "field" }, what, grid, ...(field.upload ? [upload(box, grid)] : [])),
      make("div", { className: "note muted" }),
    ];
  }
  // The cells of a row by their places: one that stays keeps what is typed in it. Returns the inputs.
  function cellsOf(box, el, grid, field) {
    const old = new Map(
      [...grid.children].filter((one) => one.pgraphKey).map((one) => [one.pgraphKey, one]),
    );
    const now = field.cells.map((cell) => {
      const key = JSON.stringify([cell.index, cell.name, cell.mark]),
        made = old.get(key) ?? input(box, el, grid, cell);
      old.delete(key);
      made.pgraphKey = key;
      return made;
    });
    for (const gone of old.values()) {
      cells.leave(gone);
      gone.remove();
    }
    now.forEach((one, i) => {
      if (grid.children[i] !== one && !one.isConnected)
        grid.insertBefore(one, grid.children[i] ?? null);
    });
    if (field.kind === "density" && !grid.querySelector(".take")) density(box, grid, field);
    return now.map((one) => (one.matches("label") ? one.lastChild : one));
  }
  function buttons(box, el, field) {
    const line = el.querySelector(".field"),
      texts = JSON.stringify(field.buttons.map((b) => b.text));
    if (el.pgraphButtons === texts) {
      line.querySelectorAll(":scope > button.own").forEach((one, i) => {
        one.title = field.buttons[i].title;
      });
      return;
    }
    el.pgraphButtons = texts;
    for (const old of line.querySelectorAll(":scope > button.own")) old.remove();
    line
      .querySelector(":scope > .grid")
      .after(
        ...field.buttons.map((b, i) =>
          pgraph.button("own", b.text, b.title, () =>
            press(box.pgraphAsk, el.pgraphField.buttons[i]),
          ),
        ),
      );
  }
  // A button without an event of its own edits a cell of the form.
  function press(ask, { event, fields }) {
    if (event) ask.press(event, fields);
    else ask.edit(fields.field, [[fields.index, fields.text]], pgraph.nextSerial());
  }
  function label(box, el, field) {
    const what = el.querySelector(".what");
    el.querySelector(".field").dataset.field = field.field;
    what.title = field.help || field.label;
    what.firstChild.textContent = field.heads ? "" : field.label;
    el.classList.toggle("heads", Boolean(field.heads));
    what.querySelector(".unit").textContent = field.heads ? "" : field.unit; // both stand in the title
    if (!field.pick) what.querySelector(".pick")?.remove();
    else if (!what.querySelector(".pick")) what.append(picker(box, el));
    what.querySelector(".pick")?.setAttribute("aria-label", `pick ${field.label} in 3D`);
    el.querySelector(".note").textContent = field.note;
    el.querySelector(".note").classList.toggle("bad", Boolean(field.bad));
    curve(el, field.curve);
  }
  // The picture of a curve below its row, with a note of its range, or with axes and further curves over the same axis.
  function curve(el, drawn) {
    el.querySelector(":scope > .curve")?.remove();
    if (!drawn) return;
    const { lines, unit, note } = drawn;
    const charts = lines.flatMap(({ t, y, title = "", dots }) => [
      ...(title ? [make("span", { className: "muted title", textContent: title })] : []),
      pgraph.chart(
        note ? `curve, ${note}` : `curve ${title}`,
        [{ t, y }, ...(dots ? [{ ...dots, dots: true }] : [])],
        false,
        !note,
        unit && ` ${unit}`,
      ),
    ]);
    const box = make("div", { className: "curve" }, ...charts);
    box.append(make("span", { className: "muted now", textContent: note ?? "" }));
    el.append(box);
    mark(el);
  }
  // Where the joints of the curve that is shown are now: {at: [x, y], text}, or null.
  let present = null;
  function mark(el = document) {
    for (const box of el.querySelectorAll(".curve:has(.axed)")) {
      box.querySelectorAll("svg").forEach((chart, i) => {
        chart.pgraphMark(present && (i ? present.at.slice(0, 1) : present.at));
      });
      box.querySelector(".muted.now").textContent = present?.text ?? "";
    }
  }
  pgraph.on("present", (now) => {
    present = now;
    mark();
  });

  // The row's numbers are taken from the next click in the 3D view.
  function picker(box, el) {
    const {
        pick,
        cells: [{ index }, ...others],
      } = el.pgraphField,
      about = pick === "axis" ? "a face or a round side" : "a point";
    return pgraph.pictureButton(
      "pick",
      "pick",
      "",
      `Pick it in the 3D view: click ${about} of a body`,
      () =>
        pgraph.picking.start(pick, {
          field: el.pgraphField.field,
          index: others.length ? index.slice(0, -1) : index,
          ...box.pgraphAsk.owner,
        }),
    );
  }

  function input(box, el, grid, cell) {
    const of = () => el.pgraphField;
    const typedIn = () =>
      [...grid.querySelectorAll(".cell")].filter((one) => isDirty(one) || one === made);
    const entriesOf = (typed) => typed.map((one) => [one.pgraphIndex, one.value]);
    const check = (serial) => {
      const entries = entriesOf(typedIn());
      made.onrefuse = (offer, note) => repair(box, of(), entries, offer, note, made);
      box.pgraphAsk.check(of().field, entries, serial);
    };
    const send = (serial) => {
      spread(made, [...grid.querySelectorAll("input.cell")], of().direction);
      const typed = typedIn(),
        entries = entriesOf(typed);
      const texts = typed.map((one) => one.value);
      made.onaccept = () =>
        typed.forEach((one, i) => {
          if (one !== made && one.value === texts[i]) cells.revert(one);
        });
      made.onrefuse = (offer, note) => repair(box, of(), entries, offer, note, made);
      box.pgraphAsk.edit(of().field, entries, serial);
    };
    const { live, label: called } = of(),
      kind = cell.kind ?? of().kind;
    let made;
    if (kind === "choice") made = cells.choice(() => made.pgraphOptions, send, { label: called });
    else if (kind === "names")
      made = cells.choice(() => names(made.pgraphOptions), send, { label: called });
    else
      made = cells.input(send, {
        label: called,
        numeric: kind === "number",
        leaving: kind !== "density",
      });
    if (live) made.addEventListener("input", () => cells.doubtful(made, check));
    made.pgraphTakes = () =>
      of().expression ? { ...box.pgraphAsk.owner, cell: of().field } : null;
    made.pgraphIndex = cell.index;
    made.pgraphOptions = paired(cell.options ?? of().options);
    const mark = cell.mark ?? cell.name;
    if (!mark) return made;
    made.style.setProperty("--letters", mark.length);
    return make(
      "label",
      { className: `axis ${["", "", "two"][mark.length] ?? "above"}` },
      make("span", { textContent: mark }),
      made,
    );
  }
  // Several numbers typed into one cell, as 0 0 1 or [0, 0, 1], are of it and of those after it; z or -z is a direction.
  function spread(cell, row, direction) {
    const text = cell.value.trim(),
      letter = direction && text.match(/^([+-]?)([xyz])$/i);
    const listed = /^[[(].*[\])]$/.test(text),
      bare = listed ? text.slice(1, -1).trim() : text;
    const parts = letter
      ? [..."xyz"].map((axis) =>
          axis === letter[2].toLowerCase() ? `${letter[1].replace("+", "")}1` : "0",
        )
      : bare.split(listed ? /\s*[,;]\s*|\s+/ : /\s*[,;]?\s+|\s*;\s*/);
    const at = letter ? 0 : row.indexOf(cell);
    if (
      parts.length < 2 ||
      at + parts.length > row.length ||
      !parts.every((part) => /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(part))
    )
      return;
    parts.forEach((part, i) => {
      row[at + i].value = part;
    });
    cell.dataset.sent = cell.value;
  }
  const paired = (options) => (options ?? []).map((one) => (Array.isArray(one) ? one : [one, one]));
  const names = (extra) => [
    ...extra.map(([n, text]) => [n, n === "*" ? "every body with a shape" : text]),
    ...(pgraph.latest.table?.rows ?? []).map((r) => [r.name, r.name]),
  ];

  function repair(box, field, entries, offer, note, cell) {
    if (!offer || !note) return;
    note.append(
      " ",
      make("button", {
        className: "action offer",
        textContent: offer,
        onclick: () => {
          cells.await(cell, (serial) => box.pgraphAsk.mend(field.field, entries, serial));
        },
      }),
    );
  }

  function density(box, grid, field) {
    const cell = grid.querySelector("input");
    cell.placeholder = "density";
    cell.dataset.shown = "";
    const send = (serial, text) => box.pgraphAsk.density(serial, text);
    cell.onaccept = () => {
      cell.dataset.full = cell.value;
    };
    cell.onrefuse = () => {
      list.value = "";
    }; // not taken: it does not say so
    cell.addEventListener(
      "keydown",
      (event) => {
        // taken by Enter; it is no cell of the model
        if (event.key !== "Enter") return;
        event.stopImmediatePropagation();
        event.preventDefault();
        take.click();
      },
      true,
    );
    const list = make(
      "select",
      { className: "cell", "aria-label": "material", title: "material" },
      make("option", { value: "", textContent: "material …" }),
      ...field.options.map(([value, text]) => make("option", { value, textContent: text })),
    );
    list.onchange = () => {
      if (!list.value) return;
      cell.value = list.value;
      take.click();
    };
    const take = make("button", {
      className: "action take",
      textContent: "Take",
      title: field.help,
      onclick: () => {
        if (!cell.value) {
          cell.focus();
          return;
        }
        cells.await(cell, send);
      },
    });
    grid.className = "grid density";
    grid.prepend(list);
    grid.append(take);
  }

  // A file is chosen among the kinds.
  function upload(box, grid) {
    const file = make("input", {
      type: "file",
      accept: ".stl,.obj,.ply,.off,.glb",
      hidden: true,
      "aria-label": "mesh file",
    });
    file.onchange = () => {
      if (file.files[0]) box.pgraphAsk.upload(file.files[0]);
      file.value = "";
    };
    grid.addEventListener(
      "change",
      (event) => {
        if (event.target.value !== "file") return;
        event.stopPropagation();
        cells.revert(event.target);
        file.click();
      },
      true,
    );
    return file;
  }

  // Named numbers: name, value, how many cells use it; the last row makes a new one.
  function parameters(box) {
    const ask = (...args) => box.pgraphAsk.parameter(...args);
    const name = cells.input(() => {}, { label: "new parameter name", leaving: false });
    const send = (serial, text) => ask("EditParameter", { serial, name: name.value, text });
    const value = cells.input(send, { label: "new parameter value", leaving: false });
    Object.assign(name, { placeholder: "name" });
    Object.assign(value, { placeholder: "value" });
    name.dataset.shown = value.dataset.shown = "";
    value.onaccept = () => {
      name.value = value.value = "";
    };
    const add = make("button", {
      className: "action",
      textContent: "Add",
      onclick: () => cells.await(value, send),
    });
    const fresh = make(
      "div",
      { className: "field parameter fresh" },
      name,
      make("span", { textContent: "=" }),
      value,
      make("span", { className: "muted used" }),
      add,
    );
    return [make("div", { className: "parameters" }, make("div"), fresh)];
  }
  function parameter(box) {
    const ask = (...args) => box.pgraphAsk.parameter(...args);
    const name = cells.input(
      (serial, text) => ask("RenameParameter", { serial, name: name.dataset.full, text }),
      { label: "parameter name" },
    );
    const value = cells.input(
      (serial, text) =>
        ask("EditParameter", {
          serial,
          name: name.dataset.full,
          text,
          row: Number(line.pgraphKey),
        }),
      { label: "parameter value", numeric: true },
    );
    const out = make(
      "button",
      {
        className: "bare",
        title: "Delete",
        "aria-label": "delete",
        onclick: () => ask("DeleteParameter", { name: name.dataset.full }),
      },
      pgraph.icon("close"),
    );
    const line = make(
      "div",
      {},
      make(
        "div",
        { className: "field parameter" },
        name,
        make("span", { textContent: "=" }),
        value,
        make("span", { className: "muted used" }),
        out,
      ),
    );
    return line;
  }
  function fillParameters(box, el, field) {
    el.firstChild.title = field.help;
    pgraph.keyed(
      el.firstChild.firstChild,
      field.rows,
      () => parameter(box),
      (line, data) => {
        const [name, value] = line.querySelectorAll(".cell");
        cells.set(name, data.name);
        cells.set(value, data.value);
        line.querySelector(".used").textContent =
          data.used === 0 ? "unused" : `${data.used} ${data.used === 1 ? "cell" : "cells"}`;
      },
    );
  }

  // The density that the mass follows from now; what is typed is an order, not the model's cell.
  function fillDensity(row, value) {
    const [list, cell] = row.querySelectorAll(".grid > .cell");
    cell.placeholder = value || "density";
    if (value && cell.value === cell.dataset.full) cell.value = "";
    list.value = [...list.options].some((option) => option.value === value) ? value : "";
  }
  function fillCell(input, field, cell) {
    const { name, index } = cell;
    input.setAttribute(
      "aria-label",
      [field.label, cell.called || name || index.map((k) => k + 1).join(" ")]
        .filter(Boolean)
        .join(" "),
    );
    const kind = cell.kind ?? field.kind,
      options = paired(cell.options ?? field.options);
    input.pgraphOptions = cell.varied ? [["", "varied"], ...options] : options;
    if (kind === "choice" || kind === "names") cells.choose(input, cell.value);
    else {
      input.placeholder = cell.varied ? "varied" : "";
      const formula = typeof cell.value === "string" && cell.value.startsWith("=");
      input.classList.toggle("formula", formula);
      cells.set(input, cell.value, field.help);
    }
    input.classList.toggle("implied", Boolean(cell.implied));
  }

  // Units and forms of this page alone; the file has radians and metres.
  function units() {
    const toggle = (what, a, b) =>
      make("button", {
        className: "action",
        "data-unit": what,
        title: "shown and typed in; files hold radians and metres",
        onclick: (event) =>
          pgraph.send("SetDisplay", { what, value: event.target.textContent === a ? b : a }),
      });
    const box = make(
      "span",
      { className: "units" },
      toggle("angle", "rad", "deg"),
      toggle("length", "m", "mm"),
    );
    box.append(
      make(
        "select",
        {
          className: "cell",
          "aria-label": "orientation as",
          title: "how orientations are shown",
          onchange: (event) =>
            pgraph.send("SetDisplay", { what: "turn", value: event.target.value }),
        },
        ...[
          ["quaternion", "quaternion"],
          ["euler", "roll pitch yaw"],
          ["axis", "axis and angle"],
        ].map(([value, textContent]) => make("option", { value, textContent })),
      ),
      make(
        "select",
        {
          className: "cell",
          "aria-label": "inertia about",
          title: "about which point the inertia is shown",
          onchange: (event) =>
            pgraph.send("SetDisplay", { what: "about", value: event.target.value }),
        },
        ...[
          ["com", "inertia: centre"],
          ["origin", "inertia: origin"],
        ].map(([value, textContent]) => make("option", { value, textContent })),
      ),
    );
    return box;
  }
  function showUnits(box, display) {
    box.querySelector('[data-unit="angle"]').textContent = display.angle;
    box.querySelector('[data-unit="length"]').textContent = display.length;
    const [turn, about] = box.querySelectorAll("select");
    turn.value = display.turn;
    about.value = display.about;
  }

  return { draw, units, showUnits };
})();

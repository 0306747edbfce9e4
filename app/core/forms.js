// Forms: groups of fields of cells. A row is taken whole: cells that were refused are sent again
// with the next one, so that an inertia or a quaternion can be typed number by number.
pgraph.forms = (() => {
  const { make, cells } = pgraph;
  const shapeOf = (groups) => JSON.stringify(groups.map((g) => [g.title, g.fields.map((f) =>
    [f.field, f.label, f.kind, f.columns, f.cells.map((c) => [c.index, c.name]), f.buttons.map((b) => b.text), f.options?.length, f.rows?.length])]));
  const isDirty = (cell) => cell.value !== cell.dataset.shown;

  // `ask` = {edit(field, entries, serial), check(...), mend(...), press(button, field), density, upload, parameter}.
  function draw(box, groups, ask, key) {
    const shape = shapeOf(groups);
    if (box.dataset.shape !== shape || box.dataset.key !== key) {
      const folded = new Map([...box.querySelectorAll(":scope > details")].map((d) => [d.dataset.title, d.open]));
      const same = box.dataset.key === key, typed = same ? halfTyped(box) : [];
      if (!same) left(box);
      box.pgraphAsk = ask;
      cells.quietly(() => box.replaceChildren(...groups.map((g) => group(box, g, folded))));
      Object.assign(box.dataset, { shape, key });
      fill(box, groups);
      cells.quietly(() => typed.forEach((one) => retyped(box, one)));
      return;
    }
    box.pgraphAsk = ask;
    fill(box, groups);
  }

  // A form goes while a cell is typed in: that is to leave the cell, which commits it.
  function left(box) {
    const cell = document.activeElement;
    if (box.contains(cell) && cell.pgraphCommit) cell.pgraphCommit();
  }
  // The same form with other fields, as others change them: what is half typed stays in its cell.
  const place = (cell) => [cell.closest("[data-field]")?.dataset.field, cell.getAttribute("aria-label")].join();
  function halfTyped(box) {
    const here = (cell) => cell === document.activeElement;
    return [...box.querySelectorAll("input.cell")].filter((cell) => isDirty(cell) || here(cell)).map((cell) => ({
      at: place(cell), text: cell.value, dirty: isDirty(cell), focused: here(cell), span: [cell.selectionStart, cell.selectionEnd] }));
  }
  function retyped(box, { at, text, dirty, focused, span }) {
    const cell = [...box.querySelectorAll("input.cell")].find((one) => place(one) === at);
    if (!cell) return;
    if (focused) cell.focus({ preventScroll: true });
    if (dirty) cell.value = text;
    if (focused) cell.setSelectionRange(...span);
  }

  function group(box, data, folded) {
    const body = make("div", {}, ...data.fields.map((f) => row(box, f)));
    if (!data.title) return body;
    return make("details", { open: folded.get(data.title) ?? data.open, "data-title": data.title },
      make("summary", { textContent: data.title }), body);
  }

  function row(box, field) {
    if (field.kind === "parameters") return parameters(box, field);
    const grid = make("div", { className: `grid columns-${field.columns}` });
    grid.append(...field.cells.map((cell) => input(box, grid, field, cell)));
    if (field.kind === "density") density(box, grid, field);
    const unit = make("span", { className: "unit" }), what = make("div", { className: "what", title: field.help || field.label }, make("span", { textContent: field.label }), unit);
    if (field.pick) what.append(picker(box, field));
    const buttons = field.buttons.map((b) => make("button", {
      className: "action small", textContent: b.text, title: b.title, onclick: () => box.pgraphAsk.press(b, field),
    }));
    if (field.upload) buttons.push(upload(box));
    return make("div", {}, make("div", { className: "field", "data-field": field.field },
      what, grid, ...buttons),
    make("div", { className: "note muted" }));
  }

  // The row's numbers are taken from the next click in the 3D view.
  function picker(box, field) {
    const about = field.pick === "axis" ? "a face or a round side" : "a point", index = field.cells[0].index.slice(0, -1);
    return pgraph.pictureButton("pick", "pick", `pick ${field.label} in 3D`, `Pick it in the 3D view: click ${about} of a body`,
      () => pgraph.picking.start(field.pick, { field: field.field, index, ...box.pgraphAsk.owner }));
  }

  function input(box, grid, field, cell) {
    const label = [field.label, cell.name || cell.index.map((i) => i + 1).join(" ")].filter(Boolean).join(" ");
    const typedIn = () => [...grid.querySelectorAll(".cell")].filter(isDirty);
    const entriesOf = (typed) => typed.map((one) => [one.pgraphIndex, one.value]);
    const check = (serial) => {
      const entries = entriesOf(typedIn());
      made.onrefuse = (offer, note) => repair(box, field, entries, offer, note, made);
      box.pgraphAsk.check(field.field, entries, serial);
    };
    const send = (serial) => {
      const typed = typedIn(), entries = entriesOf(typed);
      const texts = typed.map((one) => one.value);
      made.onaccept = () => typed.forEach((one, i) => { if (one !== made && one.value === texts[i]) cells.revert(one); });
      made.onrefuse = (offer, note) => repair(box, field, entries, offer, note, made);
      box.pgraphAsk.edit(field.field, entries, serial);
    };
    let made;
    if (field.kind === "choice") made = cells.choice(() => made.pgraphOptions, send, { label });
    else if (field.kind === "names") made = cells.choice(() => names(made.pgraphOptions), send, { label });
    else made = cells.input(send, { label, numeric: field.kind === "number", leaving: field.kind !== "density" });
    if (field.live) made.addEventListener("input", () => cells.doubtful(made, check));
    if (field.columns >= 3) made.dataset.digits = 5;
    made.pgraphIndex = cell.index;
    made.pgraphOptions = field.options ?? [];
    return cell.name ? make("label", { className: "axis" }, make("span", { textContent: cell.name }), made) : made;
  }
  const names = (extra) => [...extra.map((n) => [n, n === "*" ? "every body with a shape" : n]),
    ...(pgraph.latest.table?.rows ?? []).map((r) => [r.name, r.name])];

  function repair(box, field, entries, offer, note, cell) {
    if (!offer || !note) return;
    note.append(" ", make("button", { className: "action small offer", textContent: offer, onclick: () => {
      cells.await(cell, (serial) => box.pgraphAsk.mend(field.field, entries, serial));
    } }));
  }

  function density(box, grid, field) {
    const cell = grid.querySelector("input");
    cell.placeholder = "density";
    cell.dataset.shown = "";
    const send = (serial, text) => box.pgraphAsk.density(serial, text);
    cell.onaccept = () => { cell.dataset.full = cell.value; };
    cell.onrefuse = () => { list.value = ""; }; // not taken: it does not say so
    cell.addEventListener("keydown", (event) => { // taken by Enter; it is no cell of the model
      if (event.key !== "Enter") return;
      event.stopImmediatePropagation();
      event.preventDefault();
      take.click();
    }, true);
    const list = make("select", { className: "cell", "aria-label": "material", title: "material" },
      make("option", { value: "", textContent: "material …" }), ...field.options.map(([value, text]) => make("option", { value, textContent: text })));
    list.onchange = () => { if (!list.value) return; cell.value = list.value; take.click(); };
    const take = make("button", { className: "action small take", textContent: "Take", title: field.help, onclick: () => {
      if (!cell.value) { cell.focus(); return; }
      cells.await(cell, send);
    } });
    grid.className = "grid density";
    grid.prepend(list);
    grid.append(take);
  }

  function upload(box) {
    const file = make("input", { type: "file", accept: ".stl,.obj,.ply,.off,.glb", hidden: true, "aria-label": "mesh file" });
    file.onchange = () => { if (file.files[0]) box.pgraphAsk.upload(file.files[0]); file.value = ""; };
    const press = make("button", { className: "action small", textContent: "Mesh file …", title: "STL, OBJ, PLY, OFF or GLB, 10 MB at most", onclick: () => file.click() });
    return make("span", {}, press, file);
  }

  // Named numbers: name, value, how many cells use it; the last row makes a new one.
  function parameters(box, field) {
    const ask = (...args) => box.pgraphAsk.parameter(...args);
    const rows = field.rows.map((row) => {
      const name = cells.input((serial, text) => ask("RenameParameter", { serial, name: name.dataset.full, text }), { label: "parameter name" });
      const value = cells.input((serial, text) => ask("EditParameter", { serial, name: name.dataset.full, text }), { label: "parameter value", numeric: true });
      const out = make("button", { className: "action small", textContent: "×", onclick: () => ask("DeleteParameter", { name: name.dataset.full }) });
      return make("div", {}, make("div", { className: "field parameter" }, name, make("span", { textContent: "=" }), value, make("span", { className: "muted used" }), out));
    });
    const name = cells.input(() => {}, { label: "new parameter name", leaving: false });
    const send = (serial, text) => ask("EditParameter", { serial, name: name.value, text });
    const value = cells.input(send, { label: "new parameter value", leaving: false });
    Object.assign(name, { placeholder: "name" });
    Object.assign(value, { placeholder: "value" });
    name.dataset.shown = value.dataset.shown = "";
    value.onaccept = () => { name.value = value.value = ""; };
    const add = make("button", { className: "action small", textContent: "Add", onclick: () => cells.await(value, send) });
    const fresh = make("div", { className: "field parameter fresh" }, name, make("span", { textContent: "=" }), value, make("span", { className: "muted used" }), add);
    return make("div", { className: "parameters", title: field.help }, ...rows, fresh);
  }

  function fill(box, groups) {
    const rows = [...box.querySelectorAll(":scope > div > div, :scope > details > div > div")];
    let at = 0;
    for (const group of groups) for (const field of group.fields) {
      const row = rows[at++];
      if (field.kind === "parameters") { fillParameters(row, field); continue; }
      row.querySelector(".unit").textContent = field.unit;
      row.querySelector(".note").textContent = field.note;
      const inputs = [...row.querySelectorAll(".cell")].filter((cell) => cell.pgraphIndex);
      if (field.kind === "density") { fillDensity(row, String(field.cells[0].value)); continue; }
      field.cells.forEach((cell, i) => fillCell(inputs[i], field, cell));
    }
  }
  // The density that the mass follows from now; what is typed is an order, not the model's cell.
  function fillDensity(row, value) {
    const [list, cell] = row.querySelectorAll(".grid > .cell");
    cell.placeholder = value || "density";
    if (value && cell.value === cell.dataset.full) cell.value = "";
    list.value = [...list.options].some((option) => option.value === value) ? value : "";
  }
  function fillCell(input, field, cell) {
    input.pgraphOptions = cell.varied ? [["", "varied"], ...(field.options ?? [])] : field.options ?? [];
    if (field.kind === "choice" || field.kind === "names") cells.choose(input, cell.value);
    else {
      input.placeholder = cell.varied ? "varied" : "";
      const formula = typeof cell.value === "string" && cell.value.startsWith("=");
      input.classList.toggle("formula", formula);
      cells.set(input, cell.value, field.help);
    }
    input.classList.toggle("implied", Boolean(cell.implied));
  }
  function fillParameters(row, field) {
    const lines = row.querySelectorAll(".parameter:not(.fresh)");
    field.rows.forEach((data, i) => {
      const [name, value] = lines[i].querySelectorAll(".cell");
      cells.set(name, data.name);
      cells.set(value, data.value);
      lines[i].querySelector(".used").textContent = data.used === 0 ? "unused" : `${data.used} ${data.used === 1 ? "cell" : "cells"}`;
    });
  }

  // Units and forms of this page alone; the file has radians and metres.
  function units(show) {
    const toggle = (what, a, b) => make("button", {
      className: "action small", "data-unit": what, title: "shown and typed in; files hold radians and metres",
      onclick: (event) => pgraph.send("SetDisplay", { what, value: event.target.textContent === a ? b : a }),
    });
    const box = make("span", { className: "units" }, toggle("angle", "rad", "deg"), toggle("length", "m", "mm"));
    if (show) {
      box.append(make("select", { className: "cell", "aria-label": "orientation as", title: "how orientations are shown",
        onchange: (event) => pgraph.send("SetDisplay", { what: "turn", value: event.target.value }) },
      ...[["quaternion", "quaternion"], ["euler", "roll pitch yaw"], ["axis", "axis and angle"]].map(([value, textContent]) => make("option", { value, textContent }))),
      make("select", { className: "cell", "aria-label": "inertia about", title: "about which point the inertia is shown",
        onchange: (event) => pgraph.send("SetDisplay", { what: "about", value: event.target.value }) },
      ...[["com", "inertia: com"], ["origin", "inertia: origin"]].map(([value, textContent]) => make("option", { value, textContent }))));
    }
    return box;
  }
  function showUnits(box, display) {
    box.querySelector('[data-unit="angle"]').textContent = display.angle;
    box.querySelector('[data-unit="length"]').textContent = display.length;
    const [turn, about] = box.querySelectorAll("select");
    if (turn) { turn.value = display.turn; about.value = display.about; }
  }

  return { draw, units, showUnits };
})();

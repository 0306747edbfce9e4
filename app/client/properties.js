// Everything about the selected body, each number in a cell of its own.
(() => {
  const { make, cells } = pgraph;

  function build(host) { host.replaceChildren(make("div", { className: "properties" })); }

  function draw(host, data) {
    const box = host.firstElementChild;
    const shape = JSON.stringify(data.groups?.map((g) => g.fields.map((f) => [f.field, f.cells.length, f.columns])));
    const { name, number } = box.dataset; // a renamed body keeps its cells and their focus
    const same = box.dataset.shape === shape && (name === data.body || number === String(data.number));
    if (data.body === null) { empty(box, data); return; }
    if (!same) rebuild(box, data, shape);
    fill(box, data);
  }

  function empty(box, data) {
    delete box.dataset.shape;
    box.replaceChildren(
      make("p", { className: "muted", textContent: "Select a body: click a row, a node of the digraph, or the body itself." }),
      make("p", { className: "muted", textContent: data.hint }));
  }

  function rebuild(box, data, shape) {
    Object.assign(box.dataset, { shape, name: data.body, number: data.number });
    const heading = make("div", { className: "heading" }, make("span", { className: "chip" }), make("strong"), make("span", { className: "muted" }));
    box.replaceChildren(heading, ...data.groups.map((group) => {
      const body = make("div", {}, ...group.fields.map((field) => fieldRow(box, field)));
      if (!group.title) return body;
      return make("details", { open: group.open }, make("summary", { textContent: group.title }), body);
    }));
  }

  function fieldRow(box, field) {
    const edit = (index) => (serial, text) =>
      pgraph.send("Edit", { serial, body: box.dataset.name, field: field.field, index, text });
    const grid = make("div", { className: `grid columns-${field.columns}` }, ...field.cells.map((cell) => {
      const label = [field.label, cell.name || cell.index.map((i) => i + 1).join(" ")].filter(Boolean).join(" ");
      if (field.options) return cells.choice(() => field.options.map((o) => [o, o]), edit(cell.index), { label });
      const input = cells.input(edit(cell.index), { label, numeric: field.numeric });
      return cell.name ? make("label", { className: "axis" }, make("span", { textContent: cell.name }), input) : input;
    }));
    const unit = make("span", { className: "unit", textContent: field.unit });
    return make("div", { className: "field", "data-field": field.field },
      make("div", { className: "what", title: field.help }, make("span", { textContent: field.label }), unit), grid);
  }

  function fill(box, data) {
    Object.assign(box.dataset, { name: data.body, number: data.number });
    const [chip, name, kind] = box.querySelector(".heading").children;
    chip.style.background = data.color;
    name.textContent = data.body;
    kind.textContent = data.subtitle;
    const inputs = box.querySelectorAll(".cell");
    let at = 0;
    for (const group of data.groups) for (const field of group.fields) for (const cell of field.cells) {
      const input = inputs[at++];
      if (field.options) cells.choose(input, cell.value);
      else cells.set(input, cell.value, field.help);
      input.classList.toggle("implied", Boolean(cell.implied));
    }
  }

  pgraph.view("properties", { build, properties: draw });
})();

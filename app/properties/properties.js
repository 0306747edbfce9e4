// Everything about the selected bodies, or about the model where none is selected.
(() => {
  const { make, forms, send } = pgraph;

  function build(host) {
    host.replaceChildren(make("div", { className: "properties" },
      make("div", { className: "heading" }, make("span", { className: "chip" }), make("strong"), make("span", { className: "muted" })),
      forms.units(true),
      make("div")));
  }

  function draw(host, data) {
    const [heading, units, box] = host.firstElementChild.children;
    const [chip, name, kind] = heading.children;
    const some = data.bodies.length > 0;
    chip.style.setProperty("--body", data.color ?? "transparent");
    chip.hidden = !data.color;
    name.textContent = data.title;
    kind.textContent = data.subtitle;
    forms.showUnits(units, data.display);
    for (const select of units.querySelectorAll("select")) select.hidden = !some;
    const key = data.ids.join(); // a renamed body keeps its cells and their focus
    const another = box.dataset.key !== undefined && box.dataset.key !== key;
    if (another && !box.contains(document.activeElement)) atItsHead(host);
    forms.draw(box, data.groups, some ? ofBodies(data.bodies) : ofModel, key, pgraph.selecting);
    pgraph.selecting = false;
  }
  // A click in the 3D view may select, too.
  document.addEventListener("click", ({ target }) => { if (target.matches?.("canvas:not(.pgraph *)")) pgraph.selecting = true; }, true);

  // Another body is read from its name on; in a sheet that holds other views too, nothing moves.
  function atItsHead(host) {
    for (let el = host; el && !el.matches("[data-dock-group]"); el = el.parentElement) el.scrollTop = 0;
  }

  // What is typed after a click, before the form of what was clicked is here, is for that: Python knows which it is.
  const ofBodies = (shown) => {
    const about = (event, fields) => send(event, { bodies: pgraph.selecting ? [] : shown, ...fields });
    return {
      owner: { bodies: shown },
      edit: (field, entries, serial) => about("EditBodies", { serial, field, entries }),
      check: (field, entries, serial) => about("Check", { serial, field, entries }),
      mend: (field, entries, serial) => about("Mend", { serial, field, entries }),
      press: (button) => about("EditBodies", {
        serial: pgraph.nextSerial(), field: button.fields.field, entries: [[button.fields.index, button.fields.text]],
      }),
      density: (serial, text) => about("FillFromShape", { serial, density: text }),
      upload: (file) => pgraph.files.mesh(file, shown),
      parameter: (event, fields) => send(event, fields),
    };
  };
  const ofModel = {
    edit: (field, entries, serial) => send("EditWorld", { serial, field, entries }),
    press: (button) => send("EditWorld", { serial: pgraph.nextSerial(), field: button.fields.field, entries: [[button.fields.index, button.fields.text]] }),
    parameter: (event, fields) => send(event, fields),
  };

  pgraph.view("properties", { build, properties: draw });
})();

// Everything about the selected bodies, or about the model where none is selected.
(() => {
  const { make, forms, send } = pgraph;

  // Its name, and a menu of commands; below it the body that it hangs on.
  function head(host) {
    const more = pgraph.pictureButton("bare dots", "dots", "commands", "Commands for it", () => {
      const { right, bottom } = more.getBoundingClientRect();
      pgraph.bodyMenu(pgraph.latest.properties.bodies[0], right - 210, bottom + 4);
    });
    host.replaceChildren(
      make(
        "div",
        { className: "heading" },
        make("span", { className: "number" }),
        make("strong"),
        more,
      ),
      make("div", { className: "muted about" }),
    );
  }
  function named(host, data) {
    const [number, name, more] = host.firstChild.children;
    number.style.setProperty("--body", data.color ?? "transparent");
    number.textContent = data.number ?? "";
    number.hidden = !data.color;
    name.textContent = name.title = data.title;
    more.hidden = !data.bodies.length;
    const parent =
      data.parent && data.parent !== "ground"
        ? make("button", {
            className: "link",
            textContent: data.parent,
            onclick: () => send("Select", { body: data.parent }),
          })
        : data.parent;
    host.lastChild.replaceChildren(...(parent ? [`${data.subtitle} `, parent] : [data.subtitle]));
  }

  function build(host) {
    host.replaceChildren(
      make(
        "div",
        { className: "properties" },
        make("div"),
        make(
          "details",
          { className: "display" },
          make("summary", {}, "Units", make("span", { className: "state" })),
          forms.units(),
        ),
      ),
    );
  }

  function draw(host, data) {
    const [box, units] = host.firstElementChild.children;
    const some = data.bodies.length > 0;
    forms.showUnits(units, data.display);
    units.hidden = some; // they are those of the whole page
    units.querySelector(".state").textContent = [data.display.angle, data.display.length].join(
      ", ",
    );
    const key = data.ids.join(); // a renamed body keeps its cells and their focus
    const another = box.dataset.key !== undefined && box.dataset.key !== key;
    if (another && !box.contains(document.activeElement)) atItsHead(host);
    forms.draw(box, data.groups, some ? ofBodies(data.bodies) : ofModel, key, pgraph.selecting);
    pgraph.selecting = false;
  }
  // A click in the 3D view may select, too.
  document.addEventListener(
    "click",
    ({ target }) => {
      if (target.matches?.("canvas:not(.pgraph *)")) pgraph.selecting = true;
    },
    true,
  );

  // Another body is read from its name on; in a sheet that holds other views too, nothing moves.
  function atItsHead(host) {
    host.parentElement.scrollTop = 0;
  }

  // What is typed after a click, before the form of what was clicked is here, is for that: Python knows which it is.
  const ofBodies = (shown) => {
    const about = (event, fields) =>
      send(event, { bodies: pgraph.selecting ? [] : shown, ...fields });
    return {
      owner: { bodies: shown },
      edit: (field, entries, serial) => about("EditBodies", { serial, field, entries }),
      check: (field, entries, serial) => about("Check", { serial, field, entries }),
      mend: (field, entries, serial) => about("Mend", { serial, field, entries }),
      density: (serial, text) => about("FillFromShape", { serial, density: text }),
      upload: (file) => pgraph.files.mesh(file, shown),
      parameter: (event, fields) => send(event, fields),
    };
  };
  const ofModel = {
    edit: (field, entries, serial) => send("EditWorld", { serial, field, entries }),
    parameter: (event, fields) => send(event, fields),
  };

  pgraph.view("heading", { build: head, properties: named });
  pgraph.view("properties", { build, properties: draw });
})();

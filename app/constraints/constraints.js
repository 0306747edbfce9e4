// The list of constraints, contacts, forces and joint limits; what they leave free; picking.
(() => {
  const { make, button, forms, send } = pgraph;

  function build(host) {
    pgraph.frame.actions(
      "Connections",
      pgraph.pictureButton(
        "bare add-tie",
        "add",
        "Add a connection",
        "A constraint, contact, force, limit or loop",
        choose,
      ),
    );
    const box = make(
      "div",
      { className: "ties" },
      make("div", { className: "filter" }),
      make(
        "div",
        { className: "top" },
        make("div", { className: "report" }),
        button("assemble", "Assemble", "Move the initial state onto the constraints", () => {
          document.activeElement?.blur();
          send("AssembleState");
        }),
      ),
      make("div", { className: "lists" }),
    );
    host.replaceChildren(box);
    pgraph.inSight(host, "constraints");
  }

  // On the selected body, and all that are selected with it; otherwise a click asks for it.
  function choose() {
    const body = target(),
      { selected = [] } = pgraph.latest,
      more = selected.includes(body) ? selected.length - 1 : 0;
    const kinds = pgraph.latest.constraints.kinds.map(({ title, kinds }) => [
      title,
      kinds.map(({ part, kind, name, about }) => [
        name,
        about,
        () => send("AddPart", { part, kind, body }),
        `${part} ${kind}`,
      ]),
    ]);
    pgraph.choose(
      kinds,
      body === null
        ? "Add; its body is clicked next"
        : `Add to '${body}'${more ? ` and ${more} more selected` : ""}`,
    );
  }
  const target = () => pgraph.latest.constraints.listed ?? pgraph.latest.selection ?? null;

  function draw(host, data) {
    const box = host.querySelector(".ties");
    filter(box.querySelector(".filter"), data);
    const assemble = box.querySelector(".assemble");
    assemble.disabled = data.assembling;
    assemble.hidden = !data.lists[0].items.length;
    report(box.querySelector(".report"), data.mobility);
    const lists = box.querySelector(".lists");
    if (!lists.children.length)
      lists.append(
        ...[...data.lists, { part: "limits" }].map(({ part }) =>
          make("section", { "data-part": part }),
        ),
      );
    for (const list of data.lists) section(lists.querySelector(`[data-part="${list.part}"]`), list);
    limits(lists.querySelector('[data-part="limits"]'), data);
  }

  function filter(box, data) {
    if (data.listed === null) {
      box.replaceChildren();
      return;
    }
    box.replaceChildren(
      make("span", { textContent: `of ${data.listed} ` }),
      button("small all", "show all", "", () => send("OpenConstraints", { body: null })),
    );
  }

  function report(box, data) {
    box.className = `report ${data.state}`;
    const lines = data.lines.map((line) =>
      make(
        "li",
        { className: line.bad ? "bad" : "" },
        ...(line.constraint
          ? [
              make("button", {
                className: "link",
                textContent: line.constraint,
                onclick: () => open(line.part ?? "constraints", line.constraint),
              }),
              ` ${line.text}`,
            ]
          : [line.text]),
      ),
    );
    box.replaceChildren(
      make("div", { className: "headline", textContent: data.text }),
      ...(lines.length ? [make("ul", {}, ...lines)] : []),
    );
    if (data.state === "large")
      box.append(
        button("small", "Report", "takes seconds for a thousand bodies", () => send("AskMobility")),
      );
  }

  const open = (part, name) => send("OpenPart", { part, name });

  function section(box, list) {
    if (!box.querySelector("h4"))
      box.append(make("h4", {}, list.title, pgraph.text("span", "note")));
    box.hidden = !list.items.length;
    // what all lines would say stands above them
    const kinds = new Set(list.items.map(({ kind }) => kind)),
      one = list.part !== "sites" && kinds.size === 1;
    box.querySelector(".note").textContent = [one ? [...kinds][0] : "", list.of && `in ${list.of}`]
      .filter(Boolean)
      .join(", ");
    pgraph.keyed(
      box,
      list.items,
      () => tie(list.part),
      (el, item) => fill(el, item, one, list.of),
    );
  }

  function tie(part) {
    const el = make("div", { className: "tie" });
    const name = () => el.dataset.name;
    const line = make("div", { className: "line" });
    if (part === "constraints" || part === "contacts") {
      line.append(
        make("input", {
          type: "checkbox",
          title: "active",
          onchange: (event) => send("SwitchPart", { part, name: name(), on: event.target.checked }),
        }),
      );
    }
    line.append(
      make(
        "button",
        {
          className: "title",
          onclick: () => open(part, el.classList.contains("open") ? null : name()),
        },
        make("strong"),
        make("span", { className: "between" }),
        make("span", { className: "kind" }),
      ),
      ...(part === "constraints"
        ? [
            button(
              "small when",
              "When …",
              "Switches on or off during a run: at a time, or when something crosses a value",
              () => {
                send("AddSwitch", { constraint: name() });
                pgraph.front("Scenarios");
              },
            ),
          ]
        : []),
      button("small copy", "Copy", "Duplicate", () =>
        send("DuplicatePart", { part, name: name() }),
      ),
      button("small delete-tie", "×", "Delete", () => send("DeletePart", { part, name: name() })),
    );
    el.append(line);
    return el;
  }

  function fill(el, item, one, scenario) {
    el.classList.toggle("open", item.form !== null);
    el.classList.toggle("off", item.active === false);
    const box = el.querySelector('input[type="checkbox"]');
    if (box) {
      Object.assign(box, {
        checked: item.active,
        title: scenario ? `Acts at the start of ${scenario}` : "Acts",
      });
      box.setAttribute("aria-label", `${item.name} acts`);
    }
    el.querySelector("strong").textContent = item.name;
    el.querySelector(".between").textContent = item.between
      .split(", ")
      .filter((body) => body !== item.name)
      .join(", ");
    el.querySelector(".kind").textContent = one ? "" : item.kind;
    el.querySelector(".title").title = `${item.name}: ${item.between}`;
    el.querySelector(".title").setAttribute("aria-expanded", String(item.form !== null));
  }

  // The inspector of the part that is open, in place of the body's.
  function inspect(host, data) {
    const part = data.lists.find(({ items }) => items.some(({ form }) => form !== null))?.part;
    if (!part) {
      pgraph.cells.leave(host);
      host.replaceChildren();
      return;
    }
    const { id, name, kind, bodies, between, form } = data.lists
      .find((one) => one.part === part)
      .items.find((item) => item.form !== null);
    if (!host.firstChild) {
      host.append(
        make(
          "div",
          { className: "heading" },
          make("strong"),
          pgraph.pictureButton(
            "bare",
            "close",
            "close",
            "Back to the body or the model (Esc)",
            () => send("OpenPart", { part: host.pgraphPart, name: null }),
          ),
        ),
        make("div", { className: "muted about" }),
        make("div", { className: "form" }),
      );
    }
    host.pgraphPart = part;
    host.querySelector("strong").textContent = host.querySelector("strong").title = name;
    const links = bodies.map((body) =>
      make("button", {
        className: "link",
        textContent: body,
        onclick: () => send("Select", { body }),
      }),
    );
    host
      .querySelector(".about")
      .replaceChildren(
        `${kind}${WORDS[part]} `,
        ...(bodies.length
          ? ["on ", ...links.flatMap((link, i) => (i ? [", ", link] : [link]))]
          : [between]),
      );
    const edit = (field, entries, serial) =>
      send("EditPart", { serial, part, name, field, entries });
    forms.draw(
      host.lastChild,
      form,
      {
        edit,
        owner: { part, name },
        press: (event, { slot }) => {
          if (event === "Pick") send("Pick", { part, name, slot });
          else if (event === "AskResponse") pgraph.feedback.step(name);
          else pgraph.feedback.open();
        },
      },
      `${part} ${id}`,
    );
  }
  const WORDS = {
    constraints: " constraint",
    contacts: " contact",
    forces: "",
    sites: "",
    outputs: "",
    controls: " control",
  };

  function limits(box, data) {
    const lines = data.limits.map(({ body, text }) =>
      make(
        "div",
        { className: "tie" },
        make(
          "div",
          { className: "line" },
          make(
            "button",
            {
              className: "title",
              title: "edit in the properties of the body",
              onclick: () => send("Select", { body }),
            },
            make("strong", { textContent: body }),
            make("span", { className: "between", textContent: text }),
          ),
        ),
      ),
    );
    box.hidden = !lines.length;
    box.replaceChildren(make("h4", { textContent: "Joint limits" }), ...lines);
  }

  // -- picking: a banner over the page; the tab makes room for the digraph and comes back --------
  let picking = false,
    called = null,
    asked = "";

  function banner(data) {
    const now = JSON.stringify(data.picking ?? null),
      same = now === asked;
    asked = now; // drawn again only for another question: a button must not go under the pointer
    if (!same) document.querySelector(".pgraph-banner")?.remove();
    if (data.picking && !same) {
      const names = data.picking.names.map(([name, text]) =>
        button("small", text, "", () => send("PickName", { name })),
      );
      const { ends = [], back } = data.picking;
      if (back)
        names.push(
          button("small", "Back", "Backspace: without the last one", () => send("BackWay")),
        );
      for (const [text, closed] of ends)
        names.push(
          button(
            closed ? "small" : "small primary",
            text,
            closed ? "It returns to its first wheel" : "Enter",
            () => send("EndWay", { closed }),
          ),
        );
      document.body.append(
        make(
          "div",
          { className: "pgraph pgraph-banner", role: "status" },
          make("span", { textContent: data.picking.text, title: data.picking.text }),
          ...names,
          button("small", "Cancel", "Escape", () => send("Unpick")),
        ),
      );
      if (!picking) {
        document.activeElement?.blur();
        pgraph.front("Bodies");
      }
    } else if (picking && !data.picking) pgraph.front("Connections");
    picking = Boolean(data.picking);
    if (called !== null && data.called > called) pgraph.front("Connections"); // a page that comes back counts from 0
    called = data.called;
  }

  // A cable ends by Enter; Backspace takes back its last body.
  window.addEventListener(
    "keydown",
    (event) => {
      const asked = picking && pgraph.latest.constraints?.picking;
      if (!asked?.ends || event.target.closest?.("input, select, textarea, .pgraph-banner")) return;
      if (event.key === "Enter" && asked.ends.length) send("EndWay", { closed: false });
      else if (event.key === "Backspace" && asked.back) send("BackWay");
      else return;
      event.stopPropagation();
      event.preventDefault();
    },
    true,
  );

  // In the table a click on the selected row changes nothing, so it is handled here, and selects nothing.
  let taken = false;
  const take = (event) => {
    event.stopPropagation();
    event.preventDefault();
  };
  document.addEventListener(
    "mousedown",
    (event) => {
      const name = picking && event.target.closest?.("tr[data-name]")?.dataset.name;
      taken = Boolean(name);
      if (!taken) return;
      take(event);
      send("PickName", { name });
    },
    true,
  );
  document.addEventListener(
    "click",
    (event) => {
      if (taken && event.detail) {
        taken = false;
        take(event);
      }
    },
    true,
  );

  pgraph.on("constraints", banner);
  pgraph.on("connectionsFor", (body) => {
    if (body !== undefined) send("OpenConstraints", { body });
  });
  pgraph.view("constraints", { build, constraints: draw });
  pgraph.view("part", { constraints: inspect });
})();

// Expressions: below a cell that begins with "=", while it is typed in, stand the names that complete it,
// the unit that it expects, its present value, or what is wrong. What is clicked meanwhile is put into it.
(() => {
  const { make, send, cells } = pgraph;
  const list = make("div", { role: "listbox", id: "pgraph-words", "aria-label": "completions" }),
    said = make("div", { role: "status" });
  const box = make(
    "div",
    { className: "pgraph pgraph-popup pgraph-typed", popover: "manual" },
    list,
    said,
  );
  const PACE = 300; // [ms] between values while the shown time changes
  let cell = null,
    asked = 0,
    typed = "",
    drawn = "",
    words = [],
    start = 0,
    at = -1,
    told = 0;

  const takes = (el) =>
    el.pgraphTakes?.() ?? (el.dataset.numeric ? { part: "", name: "", cell: "" } : null);
  const isExpression = (el) =>
    Boolean(el?.matches?.(".pgraph input.cell")) &&
    el.value.trimStart().startsWith("=") &&
    takes(el) !== null;
  const caret = () => (cell.selectionStart === cell.selectionEnd ? cell.selectionStart : 0);

  // The cell in focus begins, goes on or ends to be an expression.
  function follow(el) {
    if (!isExpression(el)) {
      leave();
      return;
    }
    if (cell !== el) {
      leave();
      cell = el;
      for (const [name, value] of [
        ["role", "combobox"],
        ["aria-controls", "pgraph-words"],
        ["aria-autocomplete", "list"],
      ])
        cell.setAttribute(name, value);
      if (takes(cell).part) pgraph.picking.start("signal");
    }
    ask();
  }
  function leave() {
    if (!cell) return;
    if (takes(cell)?.part) send("EndAim");
    for (const name of [
      "role",
      "aria-controls",
      "aria-autocomplete",
      "aria-expanded",
      "aria-activedescendant",
    ])
      cell.removeAttribute(name);
    cell = null;
    box.remove();
  }
  function ask() {
    typed = cell.value;
    asked = pgraph.nextSerial();
    if (cells.tooLong(cell)) draw({ words: [], problem: cells.tooLong(cell) });
    else send("AskHint", { serial: asked, ...takes(cell), text: typed, caret: caret() });
  }

  function draw({ words: found, start: from, problem, unit, value }) {
    [words, start, drawn] = [found, from, typed];
    list.replaceChildren(
      ...words.map(([text, about], i) =>
        make(
          "div",
          {
            role: "option",
            id: `pgraph-word-${i}`,
            onmousedown: (event) => {
              event.preventDefault();
              complete(i);
            },
          },
          make("span", { textContent: text }),
          make("span", { textContent: about, title: about }),
        ),
      ),
    );
    said.textContent = words.length
      ? ""
      : problem || [unit, value && `now ${value}`].filter(Boolean).join(", ");
    said.classList.toggle("bad", Boolean(problem));
    said.hidden = !said.textContent;
    mark(words.length && start < cell.selectionStart ? 0 : -1); // nothing typed: Enter takes the cell as it is
    place();
  }
  function place() {
    if (!words.length && said.hidden) {
      box.remove();
      return;
    }
    if (!box.isConnected) document.body.append(box);
    if (!box.matches(":popover-open")) box.showPopover();
    pgraph.place(box, cell.getBoundingClientRect());
  }
  function mark(to) {
    at = to;
    [...list.children].forEach((one, i) => one.setAttribute("aria-selected", i === at));
    cell.setAttribute("aria-expanded", words.length > 0);
    cell.setAttribute("aria-activedescendant", at < 0 ? "" : `pgraph-word-${at}`);
  }
  function put(text, from, to) {
    cell.setRangeText(text, from, to, "end");
    cell.dispatchEvent(new Event("input", { bubbles: true }));
  }
  const complete = (i) => {
    if (drawn === cell.value) put(words[i][0], start, cell.selectionStart);
  }; // not of what was typed before

  pgraph.on("hint", (hint) => {
    if (!cell) return;
    if (hint.put) {
      const before = cell.value.slice(0, cell.selectionStart),
        open = before.match(/\b(q|v|out|x|u|f|force)(\.|\[["']?)?$/)?.[0] ?? "";
      put(hint.put, before.length - open.length, cell.selectionEnd);
    } else if (hint.serial === asked || !hint.serial) draw(hint);
  });
  pgraph.on("time", () => {
    if (!cell || performance.now() - told < PACE || cell.value !== typed || words.length) return;
    told = performance.now();
    ask();
  });

  document.addEventListener("input", ({ target }) => {
    if (target === document.activeElement) follow(target);
  });
  document.addEventListener("focusin", ({ target }) => {
    if (cells.resting() && target !== cell) follow(target);
  });
  document.addEventListener("focusout", () => {
    if (cells.resting()) leave();
  });
  document.addEventListener(
    "keydown",
    (event) => {
      if (cell && event.key === "Escape" && !words.length)
        setTimeout(() => {
          if (cell) follow(cell);
        }); // as it was before
      if (!cell || event.target !== cell || event.ctrlKey || event.metaKey) return;
      const completes = words.length > 0 && at >= 0 && drawn === cell.value;
      if (event.key === "Enter" && !completes) leave(); // it is taken: what is clicked from now on is not meant for it
      if (!cell || !words.length) return;
      const n = words.length,
        to = { ArrowDown: (at + 1) % n, ArrowUp: (Math.max(at, 0) + n - 1) % n }[event.key];
      if (to !== undefined) mark(to);
      else if (event.key === "Escape") {
        [asked, words] = [0, []];
        list.replaceChildren();
        mark(-1);
        place();
      } // a late answer does not open it again
      else if (["Enter", "Tab"].includes(event.key) && completes) complete(at);
      else return;
      event.preventDefault();
      event.stopImmediatePropagation();
    },
    true,
  );
  window.addEventListener(
    "scroll",
    () => {
      if (cell && box.isConnected) place();
    },
    true,
  );

  // -- what is clicked: a row or node of a body, a connection, a curve, or a body in the 3D view ------
  const CURVES = { q: "bodies", v: "bodies", output: "outputs" };
  function meant(target) {
    const body = target.closest?.("tr[data-name], g.node[data-name]"),
      tie = target.closest?.(".tie[data-name]"),
      plot = target.closest?.("figure.plot");
    if (body) return { part: "bodies", name: body.dataset.name };
    if (tie?.closest("[data-part]"))
      return { part: tie.closest("[data-part]").dataset.part, name: tie.dataset.name };
    if (!plot) return null;
    const { kind, of } = plot.dataset;
    return {
      part: CURVES[kind] ?? "outputs",
      name: kind in CURVES ? of : plot.querySelector("strong").textContent,
      rate: kind === "v",
    };
  }
  let taking = false;
  for (const type of ["pointerdown", "mousedown", "pointerup", "mouseup", "click"]) {
    document.addEventListener(
      type,
      (event) => {
        const first = type === "pointerdown",
          picks = cell && takes(cell).part && event.target !== cell;
        if (type === "mousedown" && picks && event.target.matches?.("canvas:not(.pgraph *)"))
          event.preventDefault(); // it keeps the focus
        if (first) taking = Boolean(picks && event.button === 0 && meant(event.target));
        if (!taking) return;
        event.preventDefault();
        event.stopPropagation();
        if (!first) return;
        const of = meant(event.target),
          open = /\bv(\.|\[["']?)?$/.test(cell.value.slice(0, cell.selectionStart));
        asked = pgraph.nextSerial();
        const { part, name: owner, cell: field } = takes(cell);
        send("PickSignal", {
          serial: asked,
          rate: event.shiftKey || open,
          ...of,
          of: part,
          owner,
          cell: field,
        });
      },
      true,
    );
  }
})();

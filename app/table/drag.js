// Rows dragged by their number: between two rows to move them, onto one to hang on it.
pgraph.drag = (() => {
  const { send } = pgraph;
  const table = () => pgraph.table;
  let dragged = [];

  const clear = () => {
    for (const tr of document.querySelectorAll("tr:is(.drop-before, .drop-after, .drop-on)"))
      tr.classList.remove("drop-before", "drop-after", "drop-on", "drop-loop");
  };

  // Where on a row the pointer is: its upper quarter, its lower one, or in between.
  function place(event) {
    const tr = event.target.closest?.("tr[data-name]");
    if (!tr || !dragged.length) return null;
    const box = tr.getBoundingClientRect(),
      y = (event.clientY - box.top) / box.height;
    const how = y < 0.25 ? "before" : y > 0.75 ? "after" : "on";
    return how === "on" && dragged.includes(tr.dataset.name) ? null : { tr, how };
  }

  function dropped({ tr, how }, loop) {
    const name = tr.dataset.name;
    if (how === "on" && loop) {
      send("Drop", { serial: pgraph.nextSerial(), body: dragged.at(-1), parent: name, loop });
      return;
    }
    if (how === "on") {
      send("SetParent", { bodies: dragged, parent: name });
      return;
    }
    const names = table()
      .shown()
      .filter((other) => !dragged.includes(other) || other === name);
    const at = names.indexOf(name) + (how === "after" ? 1 : 0);
    const before = names.slice(at).find((other) => !dragged.includes(other)) ?? null;
    send("MoveRows", { bodies: dragged, before });
  }

  function listen(body) {
    body.addEventListener("dragstart", (event) => {
      const tr = event.target.closest("tr[data-name]");
      if (!event.target.closest(".number") || !tr) return;
      const chosen = table().selected(),
        name = tr.dataset.name;
      dragged = chosen.includes(name) ? chosen : [name];
      event.dataTransfer.effectAllowed = "move";
      event.dataTransfer.setData("text/plain", dragged.join("\n"));
    });
    body.addEventListener("dragover", (event) => {
      const at = place(event);
      clear();
      if (!at) return;
      event.preventDefault();
      at.tr.classList.add(`drop-${at.how}`);
      if (at.how === "on" && event.shiftKey) at.tr.classList.add("drop-loop");
    });
    body.addEventListener("drop", (event) => {
      const at = place(event);
      clear();
      if (!at) return;
      event.preventDefault();
      dropped(at, event.shiftKey);
      dragged = [];
    });
    body.addEventListener("dragend", () => {
      dragged = [];
      clear();
    });
  }

  return { listen };
})();

// The table's keys, as in a spreadsheet, and its clipboard: tab-separated rows.
// A focused cell is moved from by arrows until it is typed in; then they move within its text.
pgraph.keys = (() => {
  const { send } = pgraph;
  const table = () => pgraph.table;
  const PAGE = 10; // rows
  const cellsOf = (tr) => {
    table().arm(tr);
    return [...tr.querySelectorAll(".cell, button.tied")];
  };

  function listen(host) {
    const body = host.querySelector("tbody");
    body.addEventListener("keydown", (event) => pressed(host, event), true);
    body.addEventListener("input", (event) => {
      if (event.target.matches("input")) event.target.dataset.editing = "1";
    });
    body.addEventListener("dblclick", (event) => {
      if (event.target.matches("input")) event.target.dataset.editing = "1";
    });
    body.addEventListener("focusout", (event) => {
      delete event.target.dataset.editing;
    });
  }

  function pressed(host, event) {
    const tr = event.target.closest("tr[data-name]");
    if (!tr || event.isComposing) return;
    if (action(host, tr, event)) {
      event.preventDefault();
      event.stopPropagation();
    }
  }

  // True where the key was ours.
  function action(host, tr, event) {
    const { key, target } = event,
      ctrl = event.ctrlKey || event.metaKey,
      editing = target.dataset.editing === "1";
    if (ctrl && key === "Enter") {
      pgraph.rows.add();
      return true;
    }
    if (ctrl && key.toLowerCase() === "d") {
      pgraph.rows.duplicate(host);
      return true;
    }
    if (event.altKey) return moved(tr, key);
    if (key === "Delete" && !target.matches("input")) {
      pgraph.rows.remove(host);
      return true;
    }
    if (ctrl && key.toLowerCase() === "a" && !editing) {
      everything(tr);
      return true;
    }
    if (key === "F2") return opened(target, tr);
    if (key === "Enter") return entered(tr, target, event.shiftKey ? -1 : 1);
    if (key === "Escape") return escaped(target);
    if (ctrl && !["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight", "Home", "End"].includes(key))
      return false;
    return vertical(tr, target, event, ctrl) || (!editing && horizontal(tr, target, key, ctrl));
  }

  // Escape puts back what was there; in a cell at rest it leaves the table.
  function escaped(target) {
    const rest = target.value === target.dataset.shown && !target.classList.contains("refused");
    delete target.dataset.editing;
    if (rest) target.blur();
    return rest && target.matches(".cell, button");
  }

  function vertical(tr, target, event, ctrl) {
    const names = table().shown(),
      at = names.indexOf(tr.dataset.name),
      last = names.length - 1;
    const editing = target.dataset.editing === "1";
    const to = {
      ArrowUp: ctrl ? 0 : at - 1,
      ArrowDown: ctrl ? last : at + 1,
      PageUp: at - PAGE,
      PageDown: at + PAGE,
      Home: ctrl && !editing ? 0 : undefined,
      End: ctrl && !editing ? last : undefined,
    }[event.key];
    if (to === undefined) return false;
    const name = names[Math.min(Math.max(to, 0), last)];
    if (event.shiftKey && !editing) {
      if (target !== tr) tr.focus({ preventScroll: true }); // rows are chosen, not cells
      table().tr(name).focus({ preventScroll: true });
      table().extend(name);
    } else go(name, cellsOf(tr).indexOf(target));
    return true;
  }

  function horizontal(tr, target, key, ctrl) {
    const all = cellsOf(tr),
      at = all.indexOf(target);
    const to = {
      ArrowLeft: ctrl ? 0 : at - 1,
      ArrowRight: ctrl ? all.length - 1 : at + 1,
      Home: 0,
      End: all.length - 1,
    }[key];
    if (to === undefined) return false;
    all[Math.min(Math.max(to, 0), all.length - 1)].focus();
    return true;
  }

  // The same column of another row; -1: the row itself.
  function go(name, column) {
    const tr = table().tr(name);
    tr.scrollIntoView({ block: "nearest" });
    table().pick(name);
    (column < 0 ? tr : cellsOf(tr)[column]).focus({ preventScroll: true });
  }

  function next(tr, step, column) {
    const names = table().shown(),
      name = names[names.indexOf(tr.dataset.name) + step];
    if (name !== undefined) go(name, column);
    return name !== undefined;
  }
  function rest(cell) {
    delete cell.dataset.editing;
    cell.select();
  }

  // Enter commits a cell that was typed in and goes on at once: keys that follow belong to the
  // next row however late the answer comes. A refusal appears at its cell and moves nothing.
  function entered(tr, target, step) {
    const column = cellsOf(tr).indexOf(target);
    if (column < 0) {
      cellsOf(tr)[0].focus();
      return true;
    }
    if (target.matches("button")) return false;
    if (target.matches("input") && target.value !== target.dataset.shown) {
      target.pgraphCommit();
      if (table().taken(tr, target.value)) return true;
    }
    if (!next(tr, step, column) && target.matches("input")) rest(target);
    return true;
  }

  function opened(target, tr) {
    if (target === tr) {
      cellsOf(tr)[0].focus();
      return true;
    }
    if (target.matches("select")) {
      target.showPicker?.();
      return true;
    }
    if (!target.matches("input")) return false;
    target.dataset.editing = "1";
    target.setSelectionRange(target.value.length, target.value.length);
    return true;
  }

  function everything(tr) {
    const names = table().shown();
    tr.focus({ preventScroll: true });
    send("SelectBodies", { body: tr.dataset.name, bodies: names });
  }
  window.addEventListener("keydown", (event) => {
    // where nothing is typed in
    const { key, target, ctrlKey, metaKey, shiftKey, altKey } = event,
      ctrl = ctrlKey || metaKey;
    if (
      shiftKey ||
      altKey ||
      event.defaultPrevented ||
      target.closest?.("input, textarea, select, dialog")
    )
      return;
    if (key === "Delete" && !ctrl && !target.closest?.(".pgraph"))
      pgraph.rows.remove(pgraph.host("table")); // in the 3D view
    else if (ctrl && key.toLowerCase() === "a") {
      // the browser would select the page's text
      event.preventDefault();
      const first = table().tr(table().shown()[0]);
      if (first) everything(first);
    }
  });

  // Alt: up and down among the rows, right below the row above, left to the parent's parent.
  function moved(tr, key) {
    const names = table().shown(),
      chosen = table()
        .selected()
        .filter((name) => names.includes(name));
    const bodies = chosen.length ? chosen : [tr.dataset.name];
    const first = names.indexOf(bodies[0]),
      last = names.indexOf(bodies.at(-1));
    if (key === "ArrowUp" && first > 0) send("MoveRows", { bodies, before: names[first - 1] });
    else if (key === "ArrowDown" && last + 1 < names.length)
      send("MoveRows", { bodies, before: names[last + 2] ?? null });
    else if (key === "ArrowRight" && first > 0)
      send("SetParent", { bodies, parent: names[first - 1] });
    else if (key === "ArrowLeft") {
      const up = table().row(table().row(bodies[0]).parent);
      if (up) send("SetParent", { bodies, parent: up.parent });
    } else return ["ArrowUp", "ArrowDown", "ArrowRight"].includes(key);
    return true;
  }

  // -- the clipboard: rows where rows are selected, else the text of the cell -------------------
  const here = (target) => document.querySelector('.pgraph[data-view="table"]')?.contains(target);
  const line = (name) => {
    const row = table().row(name);
    return [row.name, row.parent, `${row.dof} ${row.joint}`, row.constraint].map(quoted).join("\t");
  };
  // All that the selected bodies carry, as the server wrote it; of very many only the columns here.
  const copied = (chosen) => {
    const { bodies, text } = pgraph.latest.copied ?? {};
    return text && String(bodies) === String(chosen) ? text : chosen.map(line).join("\n");
  };
  const quoted = (text) => (/["\t\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

  document.addEventListener("copy", (event) => {
    const target = document.activeElement,
      chosen = table()?.selected() ?? [];
    const row = target?.matches("tr") || chosen.length > 1;
    if (!here(target) || !chosen.length || target.dataset.editing === "1") return;
    const text = row ? copied(chosen) : target.matches("select") ? target.value : null;
    if (text === null) return; // the browser copies the text of the cell
    event.clipboardData.setData("text/plain", text);
    event.preventDefault();
  });

  document.addEventListener("paste", (event) => {
    const target = document.activeElement,
      text = event.clipboardData.getData("text/plain");
    const cell =
      here(target) && target.matches(".cell, button.tied") && target.closest("tr[data-name]");
    const row = here(target) && target.matches("tr");
    const table_ = /[\t\n\r]/.test(text.trimEnd());
    const outside =
      table_ && (target === document.body || here(target)) && !target.matches("input, select"); // rows on the ground
    if ((!cell && !row && !outside) || target.dataset.editing === "1" || !text.trim()) return;
    if (cell && target.matches("input") && !table_) return; // typed into the cell
    event.preventDefault();
    const names = table().shown(),
      serial = pgraph.nextSerial();
    const from = cell ? names.indexOf(cell.dataset.name) : 0;
    const lines = text.trimEnd().split(/\r\n|\r|\n/).length;
    send("Paste", {
      serial,
      text,
      rows: cell ? names.slice(from, from + lines) : [],
      column: cell ? cellsOf(cell).indexOf(target) : 0,
      under: row ? table().row(target.dataset.name).parent : null,
    });
  });

  return { listen };
})();

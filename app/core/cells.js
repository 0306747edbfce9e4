// Cells that a person types into. A cell commits on Enter or leaving, reverts on Escape, keeps
// refused text with the reason below it, and is never overwritten while it is being typed in.
pgraph.cells = (() => {
  const { make } = pgraph;
  const pending = new Map(); // serial -> the cell waiting for an answer
  let quiet = false; // cells are being moved about: leaving one is nobody's doing

  const MOST = 20000; // characters that an event takes
  const tooLong = ({ value }) =>
    value.length > MOST ? `has ${value.length} characters; a cell takes ${MOST} at most` : "";

  const dirty = (cell) => cell.value !== cell.dataset.shown;
  // Four digits of a number, or those that six characters hold, which fit the narrowest cell; all of them in
  // the title, and while it is typed in. No digit before the point is rounded: from a million on, and below
  // a thousandth, a power of ten is given.
  const MOST_DIGITS = 4,
    ROOM = 6; // [characters]
  const digits = (x) => {
    const size = Math.abs(x);
    if (typeof x !== "number" || !Number.isFinite(x) || x === 0) return x;
    const before = Math.floor(Math.log10(size)) + 1; // digits before the point, or less by the zeros after it
    const text = String(
      Number(
        x.toPrecision(
          Math.max(
            before,
            Math.min(MOST_DIGITS, ROOM - (x < 0) - (before > 0 ? 1 : 2 - before)),
            2,
          ),
        ),
      ),
    );
    return text.includes("e") || size >= 1e6 || (size < 1e-3 && text.length > ROOM)
      ? x
          .toExponential(2)
          .replace(/\.?0+e/, "e")
          .replace("e+", "e")
      : text;
  };

  // The current value of the model; typed text that is not yet taken stays.
  function set(cell, value, title = "") {
    const untouched = !dirty(cell) || cell.dataset.shown === undefined;
    cell.dataset.full = String(value);
    if (!cell.classList.contains("refused")) cell.title = title || cell.dataset.full;
    if (!untouched) return;
    show(cell, document.activeElement === cell ? cell.dataset.full : digits(value));
  }
  function show(cell, text) {
    cell.value = cell.dataset.shown = text;
    cell.pgraphBegan = null;
  }
  function settled(cell) {
    const full = cell.dataset.full ?? "";
    return cell.dataset.numeric && full !== "" && !Number.isNaN(Number(full))
      ? digits(Number(full))
      : full;
  }

  function revert(cell) {
    cell.classList.remove("refused", "waiting");
    cell.removeAttribute("aria-invalid");
    delete cell.dataset.sent;
    sentence(cell, "");
    show(cell, document.activeElement === cell ? cell.dataset.full : settled(cell));
  }

  // Enter asks again what was refused, as another cell may have made it possible.
  function commit(cell, send, anew = false) {
    const asked = cell.classList.contains("waiting"); // back to what it was, while another value is on its way
    if (!dirty(cell) && !cell.pgraphAsks && !asked) {
      if (!cell.classList.contains("refused")) revert(cell);
      return;
    }
    const said = asked || (!anew && cell.classList.contains("refused"));
    if (cell.dataset.sent === cell.value && said) return;
    ask(cell, send);
  }
  // Sends what the cell holds, changed or not, and waits for the answer.
  function ask(cell, send) {
    if (tooLong(cell)) {
      refuse(cell, tooLong(cell));
      return;
    }
    const serial = pgraph.nextSerial();
    pending.set(serial, { cell, send });
    cell.pgraphSerial = serial;
    cell.dataset.sent = cell.value;
    cell.classList.add("waiting");
    pgraph.since(cell.pgraphBegan, () => send(serial, cell.value));
  }

  // Python's answer: taken, or the sentence that says why not.
  function reply({ serial, text, offer, failed }) {
    const { cell, doubt } = pending.get(serial) ?? {};
    pending.delete(serial);
    if (doubt) {
      doubt(text, offer);
      return;
    }
    if (!cell?.isConnected) {
      if (text) pgraph.toast(text);
      return;
    }
    if (cell.pgraphSerial !== serial) return; // it was typed in and sent again since
    cell.classList.remove("waiting");
    if (!text) {
      cell.onaccept?.();
      if (cell.value === cell.dataset.sent) revert(cell);
      return;
    }
    // A choice that stayed could not be made again, and a fault is not a matter of the text.
    if (failed || cell.matches("select")) revert(cell);
    refuse(cell, text, offer);
  }
  function refuse(cell, text, offer = "") {
    cell.classList.add("refused");
    cell.pgraphBegan = null; // asked again, it is of what the page shows then
    cell.setAttribute("aria-invalid", "true");
    cell.title = text;
    sentence(cell, text);
    cell.onrefuse?.(offer, noteOf(cell));
    noteOf(cell)?.scrollIntoView({ block: "nearest" });
  }
  // What there is to say of a cell while it is typed in: one question at a time, the last text wins.
  function doubtful(cell, send) {
    if (cell.pgraphDoubting) return;
    if (!dirty(cell) || tooLong(cell)) {
      if (!cell.classList.contains("refused")) sentence(cell, tooLong(cell));
      return;
    }
    const serial = pgraph.nextSerial(),
      typed = cell.value;
    cell.pgraphDoubting = true;
    pending.set(serial, {
      cell,
      send,
      doubt(text, offer) {
        cell.pgraphDoubting = false;
        if (!cell.isConnected || !dirty(cell) || cell.classList.contains("waiting")) return;
        if (cell.value !== typed) {
          doubtful(cell, send);
          return;
        }
        if (cell.classList.contains("refused") && cell.dataset.sent === typed) return;
        sentence(cell, text);
        if (text) cell.onrefuse?.(offer, noteOf(cell));
      },
    });
    send(serial, typed);
  }

  // After a lost connection: what was not answered is asked again, as far as it is an edit.
  function again() {
    const lost = [...pending.values()];
    pending.clear();
    for (const { cell, send, doubt } of lost) {
      if (doubt) {
        cell.pgraphDoubting = false;
        continue;
      }
      cell.classList.remove("waiting");
      if (cell.isConnected && cell.pgraphCommit && dirty(cell)) ask(cell, send);
    }
  }
  // Another model was opened: what was typed for the one before is not put into this one.
  let opened = null;
  function forget(count) {
    const another = opened !== null && count > opened; // a server that was started again counts from 0
    opened = count;
    if (!another) return;
    for (const cell of document.querySelectorAll(".pgraph .cell")) {
      if (
        cell.pgraphAsks ||
        cell.dataset.full === undefined ||
        !(dirty(cell) || cell.matches(".refused, .waiting"))
      )
        continue;
      cell.pgraphSerial = null; // a question, as New asks one, still has its answer
      if (cell === document.activeElement && dirty(cell))
        pgraph.toast(`“${cell.value}” was not taken: another model was opened meanwhile.`);
      revert(cell);
    }
  }

  // Refused text and notices go. Returns whether there were any.
  function clear() {
    const refused = document.querySelectorAll(".pgraph .cell.refused"),
      notes = document.querySelectorAll(".pgraph-toast:not(.good)");
    refused.forEach(revert);
    notes.forEach((note) => note.remove());
    return refused.length + notes.length > 0;
  }

  function noteOf(cell) {
    const note = (cell.closest("tr, .field, .ask") ?? cell.parentElement).nextElementSibling;
    return note?.classList.contains("sentence") ? (note.querySelector("td") ?? note) : null;
  }

  // The sentence stands below the row of the cell.
  function sentence(cell, text) {
    const row = cell.closest("tr, .field, .ask") ?? cell.parentElement;
    let note = row.nextElementSibling;
    if (!note?.classList.contains("sentence")) note = null;
    if (!text) {
      note?.remove();
      return;
    }
    if (!note) {
      note = row.matches("tr")
        ? make(
            "tr",
            { className: "sentence" },
            make("td", { colSpan: row.cells.length, role: "alert" }),
          )
        : make("div", { className: "sentence", role: "alert" });
      row.after(note);
    }
    (note.querySelector("td") ?? note).textContent = text;
  }

  // A text cell; `send(serial, text)` sends its event.
  function input(send, { label, numeric = false, className = "", leaving = true } = {}) {
    const cell = make("input", {
      type: "text",
      className: `cell ${className}`,
      spellcheck: false,
      autocomplete: "off",
      "aria-label": label,
    });
    if (numeric) {
      cell.dataset.numeric = "1";
      cell.inputMode = "decimal";
    }
    cell.addEventListener("focus", () => {
      if (quiet) return;
      if (!dirty(cell) && leaving) show(cell, cell.dataset.full ?? "");
      cell.select();
    });
    cell.addEventListener("input", () => {
      cell.pgraphBegan ??= pgraph.latest.version ?? null;
    });
    cell.pgraphAsks = !leaving; // a question is answered by nothing too
    if (leaving) cell.pgraphCommit = () => commit(cell, send);
    if (leaving)
      cell.addEventListener("blur", () => {
        if (!quiet) commit(cell, send);
      });
    cell.addEventListener("keydown", (event) => {
      if (event.key === "Enter") {
        event.preventDefault(); // a question that this asks must not be answered by the same key
        commit(cell, send, true);
      } else if (event.key === "Escape" && leaving) revert(cell);
      else return;
      event.stopPropagation();
    });
    return cell;
  }

  // A drop-down that holds its one value and is filled by `options()` when it is opened.
  function choice(options, send, { label, className = "" } = {}) {
    const cell = make("select", { className: `cell ${className}`, "aria-label": label });
    const fill = () => {
      const known = options();
      const current = cell.value;
      cell.replaceChildren(
        ...known.map(([value, text]) => make("option", { value, textContent: text })),
      );
      cell.value = current;
    };
    cell.addEventListener("mousedown", fill);
    cell.addEventListener("focus", fill);
    cell.addEventListener("keydown", (event) => {
      if (event.key === "Escape") revert(cell);
    });
    cell.addEventListener("change", () => commit(cell, send));
    cell.textOf = (value) => options().find(([known]) => known === value)?.[1] ?? value;
    return cell;
  }
  function choose(cell, value) {
    cell.dataset.full = value;
    if (cell.classList.contains("waiting")) return;
    if (![...cell.options].some((option) => option.value === value)) {
      cell.replaceChildren(make("option", { value, textContent: cell.textOf(value) }));
    }
    show(cell, value);
    cell.title = cell.selectedOptions[0]?.textContent ?? "";
  }

  // `act` takes cells away or puts them there: leaving one is nobody's doing.
  function quietly(act) {
    const before = quiet;
    quiet = true;
    try {
      act();
    } finally {
      quiet = before;
    }
  }

  // What holds the cell that is typed in goes: that is to leave the cell, which commits it.
  function leave(box) {
    const cell = document.activeElement;
    if (box.contains(cell)) cell.pgraphCommit?.();
  }

  // `act` may move the focused cell, which takes the focus from it: it has it back afterwards.
  function keepingFocus(act) {
    const cell = document.activeElement,
      [from, to] = [cell?.selectionStart, cell?.selectionEnd];
    quietly(() => {
      act();
      if (cell?.isConnected && document.activeElement !== cell) {
        cell.focus({ preventScroll: true });
        if (typeof from === "number") cell.setSelectionRange(from, to);
      }
    });
  }

  return {
    digits,
    tooLong,
    set,
    reply,
    again,
    clear,
    forget,
    doubtful,
    revert,
    await: ask,
    input,
    choice,
    choose,
    commit,
    leave,
    quietly,
    keepingFocus,
    resting: () => !quiet,
  };
})();
pgraph.on("reply", pgraph.cells.reply);
pgraph.on("opened", pgraph.cells.forget);

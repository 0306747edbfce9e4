// Buttons, and keyed lists: what every view is built from.

// A button with a word on it, and one with a picture and an accessible name.
pgraph.button = (className, textContent, title, onclick) =>
  pgraph.worded(
    pgraph.make("button", { className: `action ${className}`, title, onclick }),
    textContent,
  );
// The word on a button; a cross is drawn, and its title names it.
pgraph.worded = (made, word) => {
  if (word === "×") {
    made.setAttribute("aria-label", made.title);
    made.classList.add("icon-only");
  }
  made.replaceChildren(word === "×" ? pgraph.icon("close") : word);
  return made;
};
// A button that acts when it is pressed, not when it is let go: for what cannot wait.
pgraph.pressButton = (className, textContent, title, act) => {
  const made = pgraph.button(className, textContent, title, (event) => {
    if (event.detail === 0) act();
  }); // by a key
  made.addEventListener("pointerdown", (event) => {
    if (event.button === 0 && !made.disabled) act();
  });
  return made;
};
pgraph.pictureButton = (className, icon, label, title, onclick) => {
  const made = pgraph.button(`icon-only ${className}`, "", title, onclick);
  made.setAttribute("aria-label", label);
  made.append(pgraph.icon(icon));
  return made;
};
pgraph.text = (tag, className, textContent = "") => pgraph.make(tag, { className, textContent });

// The sentence below a row or cell, as cells.js puts it there.
pgraph.sentenceOf = (el) =>
  el?.nextElementSibling?.classList.contains("sentence") ? el.nextElementSibling : null;

// Makes the children of `box` follow `items`, which have names, and an `id` where their names may
// change. An item keeps its element, and with it focus and half-typed text, as long as it has its id.
// `create(item)` makes an element, `fill(el, item)` draws the item in it, `gone(el)` is told before one
// is removed, and the cell in it that is typed in is left, which commits it. Other children, and
// sentences below elements, stay. Returns the elements by name.
pgraph.keyed = (box, items, create, fill, gone = () => {}) => {
  const ours = (el) => el.pgraphKey !== undefined;
  const left = new Map([...box.children].filter(ours).map((el) => [el.pgraphKey, el])),
    now = new Map();
  pgraph.cells.keepingFocus(() => {
    for (const item of items) {
      const key = String(item.id ?? item.name),
        el = left.get(key) ?? create(item);
      left.delete(key);
      el.pgraphKey = key;
      if (el.dataset.name !== item.name) el.dataset.name = item.name;
      now.set(key, el);
      fill(el, item);
    }
    for (const el of left.values()) {
      pgraph.cells.leave(el);
      gone(el);
      pgraph.sentenceOf(el)?.remove();
      el.remove();
    }
    let at = [...box.children].find(ours) ?? null;
    for (const el of now.values()) {
      // all in place, the common case, costs no move
      const sentence = pgraph.sentenceOf(el);
      if (at === el) {
        at = (sentence ?? el).nextElementSibling;
        continue;
      }
      box.insertBefore(el, at);
      if (sentence) el.after(sentence);
    }
  });
  return new Map([...now.values()].map((el) => [el.dataset.name, el]));
};

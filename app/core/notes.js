// Notices: one kind, at one place above the playback. viser's own are not shown.
(() => {
  const { make } = pgraph;
  const MOST = 3; // at once
  const LASTS = { good: 6000, bad: 14000 }; // [ms]

  function place() {
    let notes = document.querySelector(".pgraph-toasts");
    if (!notes) document.body.append((notes = make("div", { className: "pgraph-toasts" })));
    return notes;
  }

  // A title and a text, either may be empty; a long text is three lines until "more" is pressed.
  function tell(title, text, good) {
    const notes = place(),
      same = [...notes.children].find((one) => one.dataset.says === `${title}\n${text}`);
    if (same) {
      last(same, good);
      return;
    }
    const close = make(
      "button",
      { className: "bare close", "aria-label": "close", onclick: () => note.remove() },
      pgraph.icon("close"),
    );
    const said = make("div", { className: "said", textContent: text });
    const more = make("button", {
      className: "link more",
      textContent: "more",
      hidden: true,
      onclick: () => {
        note.classList.add("whole");
        more.hidden = true;
      },
    });
    const note = make(
      "div",
      {
        className: `pgraph pgraph-toast${good ? " good" : ""}`,
        role: good ? "status" : "alert",
        "data-says": `${title}\n${text}`,
      },
      ...(title ? [make("strong", { textContent: title })] : []),
      ...(text ? [said] : []),
      more,
      close,
    );
    notes.append(note);
    while (notes.childElementCount > MOST) notes.firstElementChild.remove();
    more.hidden = said.scrollHeight <= said.clientHeight + 1;
    if (more.hidden) more.remove(); // its word is no part of what is said
    last(note, good);
  }
  // It goes by itself, but not from under who reads it.
  function last(note, good) {
    clearTimeout(note.pgraphLasts);
    note.pgraphLasts = setTimeout(
      () => {
        if (note.matches(":hover, :focus-within, .whole")) last(note, good);
        else note.remove();
      },
      good ? LASTS.good : LASTS.bad,
    );
  }
  pgraph.toast = (text, good = false) => tell("", text, good);
  pgraph.on("notice", ({ title, text, bad, withdrawn }) => {
    if (!withdrawn) {
      tell(title, text, !bad);
      return;
    }
    for (const note of document.querySelectorAll(".pgraph-toast"))
      if (note.querySelector("strong")?.textContent === title) note.remove();
  });

  // -- a lost connection: viser then replaces how it sends by a function that only complains -------
  const LOST = 2; // seconds in a row without it
  let without = 0;
  setInterval(() => {
    without = String(window.__viserMutable?.sendMessage).includes("not connected")
      ? without + 1
      : 0;
    const sign = document.querySelector(".pgraph-lost"),
      on = without > LOST && "table" in pgraph.latest;
    if (on && !sign)
      document.body.append(
        make("div", {
          className: "pgraph pgraph-lost",
          role: "alert",
          textContent:
            "Connection lost. Trying again; what you typed is kept. If it does not come back, start pgraph again and reload.",
        }),
      );
    else if (!on) sign?.remove();
  }, 1000);
})();

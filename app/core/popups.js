// What opens over the page: a box below a button, and a menu of commands. The browser's popovers close
// by Escape or a click elsewhere.
(() => {
  const { make } = pgraph;
  const MARGIN = 8; // [px] to the edges of the window

  // Within the window, below the anchor, or above it where there is more room.
  function place(box, { left, right, top, bottom }, end = false) {
    const { offsetWidth: w, offsetHeight: h } = box,
      below = innerHeight - bottom > h + MARGIN || innerHeight - bottom > top;
    box.style.left = `${Math.max(Math.min(end ? right - w : left, innerWidth - w - MARGIN), MARGIN)}px`;
    box.style.top = below
      ? `${Math.max(Math.min(bottom + 4, innerHeight - h - MARGIN), MARGIN)}px`
      : "auto";
    box.style.bottom = below
      ? "auto"
      : `${Math.min(innerHeight - top + 4, Math.max(innerHeight - h - MARGIN, MARGIN))}px`; // it grows upwards
  }

  pgraph.place = place;
  // A button that opens `box` at itself or at `anchor`; `end`: their right edges are aligned. `opening` is called before.
  pgraph.opens = (button, box, { end = false, anchor = button, opening = () => {} } = {}) => {
    box.classList.add("pgraph", "pgraph-popup");
    box.popover = "auto";
    button.popoverTargetElement = box;
    button.setAttribute("aria-haspopup", "true");
    box.addEventListener("beforetoggle", ({ newState }) => {
      if (newState === "open") opening();
    });
    box.addEventListener("toggle", ({ newState }) => {
      button.setAttribute("aria-expanded", newState === "open");
      if (newState === "open") place(box, anchor.getBoundingClientRect(), end);
    });
    document.body.append(box);
    return button;
  };

  // Lines of a menu: [text, keys, act, {className, about}], null for a rule between groups, or a heading.
  pgraph.menuLines = (items, close) =>
    items.map((item) => {
      if (!item) return make("hr", { role: "separator" });
      if (typeof item === "string") return make("h4", { textContent: item });
      const [text, keys, act, { className = "", about = "" } = {}] = item;
      return make(
        "button",
        {
          role: "menuitem",
          tabIndex: -1,
          className,
          title: about,
          onclick: () => {
            close();
            act();
          },
        },
        make("span", { textContent: text }),
        make("kbd", { textContent: keys, hidden: !keys }),
      );
    });
  // A button that opens a menu of what `items()` returns.
  pgraph.menuButton = (button, label, items, options = {}) => {
    const box = make("div", { role: "menu", "aria-label": label, onkeydown: keyed });
    box.classList.add("pgraph-menu");
    const fill = () => box.replaceChildren(...pgraph.menuLines(items(), () => box.hidePopover()));
    box.addEventListener("toggle", ({ newState }) => {
      if (newState === "open") box.querySelector("button")?.focus();
    });
    return pgraph.opens(button, box, { ...options, opening: fill });
  };

  // A menu at a point; the focus comes back to where it was.
  pgraph.menu = (title, items, x, y) => {
    const before = document.activeElement,
      box = make("div", {
        className: "pgraph pgraph-popup pgraph-menu",
        role: "menu",
        "aria-label": `commands for ${title}`,
        popover: "auto",
        onkeydown: keyed,
      });
    box.append(
      make("strong", { textContent: title }),
      ...pgraph.menuLines(items, () => box.hidePopover()),
    );
    box.addEventListener("toggle", ({ newState }) => {
      if (newState !== "closed") return;
      if (document.activeElement === document.body || box.contains(document.activeElement))
        before?.focus?.({ preventScroll: true });
      box.remove();
    });
    document.body.append(box);
    box.showPopover();
    place(box, { left: x, right: x, top: y, bottom: y });
    box.querySelector("button").focus();
  };
  function keyed(event) {
    const all = [...event.currentTarget.querySelectorAll("button")],
      at = all.indexOf(document.activeElement),
      n = all.length;
    const to = { ArrowDown: (at + 1) % n, ArrowUp: (at + n - 1) % n, Home: 0, End: n - 1 }[
      event.key
    ];
    if (event.key === "Tab") event.currentTarget.hidePopover();
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    all[to].focus();
  }
  window.addEventListener("blur", () =>
    document.querySelectorAll(".pgraph-menu:popover-open").forEach((box) => box.hidePopover()),
  );

  // A dialog with a heading: it closes by Escape, its button, or a click beside it.
  pgraph.dialog = (title, className, ...children) => {
    const close = make(
      "button",
      {
        className: "bare close",
        title: "Close (Esc)",
        "aria-label": "close",
        onclick: () => box.close(),
      },
      pgraph.icon("close"),
    );
    const box = make(
      "dialog",
      {
        className: `pgraph pgraph-dialog ${className}`,
        "aria-label": title,
        onclose: () => box.remove(),
      },
      make("header", {}, make("h2", { textContent: title }), close),
      make("div", { className: "content" }, ...children),
    );
    box.addEventListener("mousedown", (event) => {
      if (event.target === box) box.close();
    });
    document.body.append(box);
    box.showModal();
    return box;
  };
  // Whether Escape is for something that is open over the page.
  pgraph.overlaid = () => document.querySelector("dialog:modal, :popover-open") !== null;
})();

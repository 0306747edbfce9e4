// Search of bodies and commands (Ctrl+K, Ctrl+F), or of what can be added. A feature declares its
// commands with `pgraph.commands`.
pgraph.palette = (() => {
  const { make } = pgraph;
  const groups = new Map(); // group -> [[text, keys, act, about]]
  const MOST = 60; // lines

  // `lines` are [text, keys, act, about], or a function that returns them.
  pgraph.commands = (group, lines) => groups.set(group, [...(groups.get(group) ?? []), lines]);
  const all = () =>
    [...groups].flatMap(([group, parts]) =>
      parts
        .flatMap((part) => (typeof part === "function" ? part() : part))
        .map((line) => [group, ...line]),
    );

  function open(known = all(), asked = "Search bodies and commands") {
    if (document.querySelector("dialog:modal")) return;
    const input = make("input", {
      type: "text",
      role: "combobox",
      "aria-expanded": "true",
      "aria-controls": "pgraph-found",
      placeholder: asked,
      "aria-label": asked,
      spellcheck: false,
      autocomplete: "off",
    });
    const found = make("div", {
      className: "found",
      id: "pgraph-found",
      role: "listbox",
      "aria-label": "found",
    });
    const box = pgraph.dialog(
      "search",
      "pgraph-palette",
      make("div", { className: "ask-line" }, pgraph.icon("search"), input),
      found,
    );
    const run = (line) => {
      if (line[3]) {
        box.close();
        line[3]();
      }
    };
    let at = 0,
      lines = [];
    const mark = (to) => {
      at = Math.min(Math.max(to, 0), lines.length - 1);
      found
        .querySelectorAll("[role=option]")
        .forEach((one, i) => one.setAttribute("aria-selected", i === at));
      found.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
    };
    const fill = () => {
      const words = input.value.toLowerCase().split(/\s+/).filter(Boolean),
        text = (line) => `${line[0]} ${line[1]} ${line[4] ?? ""}`.toLowerCase();
      const starts = (line) => words.length > 0 && line[1].toLowerCase().startsWith(words[0]);
      lines = known.filter((line) => words.every((word) => text(line).includes(word)));
      if (words.length) lines = [...lines.filter(starts), ...lines.filter((line) => !starts(line))];
      lines = lines.slice(0, MOST);
      lines = [...new Set(lines.map(([group]) => group))].flatMap((group) =>
        lines.filter((line) => line[0] === group),
      );
      found.replaceChildren(
        ...lines.flatMap((line, i) => [
          ...(line[0] !== lines[i - 1]?.[0] ? [make("h4", { textContent: line[0] })] : []),
          make(
            "div",
            {
              role: "option",
              "data-kind": line[5] ?? "",
              "aria-disabled": !line[3],
              onclick: () => run(line),
              onpointermove: () => mark(i),
            },
            make("span", { textContent: line[1] }),
            make("span", { className: "about", textContent: line[4] ?? "", title: line[4] ?? "" }),
            make("kbd", { textContent: line[2], hidden: !line[2] }),
          ),
        ]),
        ...(lines.length ? [] : [make("div", { className: "none", textContent: "Nothing found" })]),
      );
      mark(0);
    };
    input.addEventListener("input", fill);
    input.addEventListener("keydown", (event) => {
      const to = { ArrowDown: at + 1, ArrowUp: at - 1, PageDown: at + 8, PageUp: at - 8 }[
        event.key
      ];
      if (to !== undefined) mark(to);
      else if (event.key === "Enter" && lines[at]) run(lines[at]);
      else return;
      event.preventDefault();
      event.stopPropagation();
    });
    fill();
    input.focus();
  }

  window.addEventListener(
    "keydown",
    (event) => {
      if (
        !["k", "f"].includes(event.key.toLowerCase()) ||
        !(event.ctrlKey || event.metaKey) ||
        event.shiftKey ||
        event.altKey
      )
        return;
      event.preventDefault();
      event.stopPropagation();
      document.activeElement?.blur?.(); // what is typed is taken first
      open();
    },
    true,
  );
  // Groups of lines [name, about, act, key]; of a line without `act` it is said why.
  pgraph.choose = (groups, asked) =>
    open(
      groups.flatMap(([group, lines]) =>
        lines.map(([name, about, act, key]) => [group, name, "", act, about, key]),
      ),
      asked,
    );
  return { open };
})();

// The sheet of all keys, opened by "?".
pgraph.shortcuts = (() => {
  const { make } = pgraph;
  const SHEET = [
    [
      "Anywhere",
      [
        ["Ctrl K", "search bodies and commands"],
        ["Ctrl S", "save"],
        ["Ctrl O", "open"],
        ["Ctrl Z", "undo"],
        ["Ctrl Shift Z", "redo"],
        ["Space", "play or pause, Shift Space computes it again"],
        ["Esc", "clear the selection"],
        ["F6", "next pane, Shift F6 the one before"],
        ["Ctrl B", "show or hide the model, Ctrl I the selection"],
        ["?", "this sheet"],
      ],
    ],
    [
      "In the 3D view",
      [
        ["F", "frame what is selected, or all"],
        ["1", "from the front, 2 from the side, 3 from the top"],
        ["0", "isometric"],
        ["C", "turn about the selection"],
        ["M", "measure between two points"],
        ["drag", "turn the view; with the right button move it"],
        ["wheel", "nearer or farther"],
        ["click", "select a body; with the right button its menu"],
        ["Ctrl drag", "pull on a body while Live runs"],
      ],
    ],
    [
      "In the digraph",
      [
        ["drag", "a number of the table onto its new parent"],
        ["Shift drag", "onto a second parent: closes a loop"],
        ["↑ ↓ ← →", "along the tree, Enter selects"],
      ],
    ],
    [
      "In cells",
      [
        ["0.2/2", "arithmetic: + - * / ^ ( ), pi"],
        ["50 mm", "a unit with the number: mm, cm, m, deg, rad, g, kg, t"],
        ["0 0 1", "several numbers fill the row from this cell on, also [0, 0, 1]"],
        ["z", "in an axis: along z; -z against it"],
      ],
    ],
    [
      "In the table",
      [
        ["↑ ↓ ← →", "next cell"],
        ["Tab", "next cell, Shift Tab the one before"],
        ["Home End", "first or last cell of the row"],
        ["Ctrl ↑ ↓", "first or last row"],
        ["F2", "edit the cell; typing replaces its content"],
        ["Enter", "commit and go down, Shift Enter up"],
        ["Esc", "restore the value"],
      ],
    ],
    [
      "Rows",
      [
        ["Shift ↑ ↓", "select several; also Shift click, Ctrl click"],
        ["Ctrl A", "select all"],
        ["Ctrl Enter", "add a body"],
        ["Ctrl D", "duplicate"],
        ["Delete", "delete the selected rows (click their number)"],
        ["Alt ↑ ↓", "move up or down"],
        ["Alt →", "attach to the row above"],
        ["Alt ←", "attach to the parent’s parent"],
        ["Ctrl C, Ctrl V", "copy rows, paste rows of a spreadsheet"],
      ],
    ],
  ];

  function open() {
    if (document.querySelector("dialog:modal")) return;
    const keys = (text) =>
      text.split(", ").flatMap((part, i) => [i ? ", " : "", make("kbd", { textContent: part })]);
    const part = ([title, lines]) =>
      make(
        "section",
        {},
        make("h3", { textContent: title }),
        make(
          "dl",
          {},
          ...lines.flatMap(([key, what]) => [
            make("dt", {}, ...keys(key)),
            make("dd", { textContent: what }),
          ]),
        ),
      );
    pgraph.dialog(
      "Keyboard shortcuts",
      "pgraph-keys",
      make("div", { className: "columns" }, ...SHEET.map(part)),
    );
  }

  window.addEventListener("keydown", (event) => {
    if (event.key !== "?" || event.target.closest?.("input, select, textarea, dialog")) return;
    event.preventDefault();
    open();
  });
  return { open };
})();

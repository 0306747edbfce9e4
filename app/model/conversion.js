// What became of a file of another format: a list next to the model; a line leads to its body.
// And the choice between the models of an archive.
(() => {
  const { make, send } = pgraph;
  const ORDER = ["warning", "left out", "approximated", "converted", "read"];

  pgraph.on("conversion", (report) => {
    document.querySelector("dialog.pgraph-conversion")?.remove();
    const word = report.loaded
      ? "Nothing that acts is left out."
      : "Some of what acts is left out.";
    const sheet = make(
      "dialog",
      {
        className: "pgraph pgraph-conversion",
        "aria-label": "report of the file",
        onclose: () => sheet.remove(),
      },
      make("strong", { textContent: report.file }),
      make("div", { className: "muted", textContent: word }),
      make(
        "div",
        { className: "lines" },
        ...ORDER.flatMap((kind) => report.entries.filter((line) => line.kind === kind).map(shown)),
      ),
      make("button", {
        className: "action primary close",
        textContent: "Close",
        onclick: () => sheet.close(),
      }),
    );
    document.body.append(sheet);
    sheet.show();
  });

  // An archive of several models: a button each; the page still has the archive.
  pgraph.on("members", ({ file, names }) => {
    const sheet = pgraph.dialog(
      `${file}: which of its ${names.length} models?`,
      "pgraph-members",
      ...names.map((name) =>
        pgraph.button("member", name, "", () => {
          pgraph.files.member(file, name);
          sheet.close();
        }),
      ),
    );
  });

  function shown(line) {
    const known = line.part && pgraph.latest.table?.rows?.some?.((row) => row.name === line.part);
    const words = [
      make("span", { className: `kind ${line.acts ? "acts" : ""}`, textContent: line.kind }),
      make("span", { className: "muted", textContent: line.where }),
      make("span", { textContent: line.text }),
    ];
    if (!line.part) return make("div", { className: "line" }, ...words);
    return make(
      "button",
      {
        className: "line",
        title: known === false ? "" : `Select ${line.part}`,
        onclick: () => send("Select", { body: line.part }),
      },
      ...words,
    );
  }
})();

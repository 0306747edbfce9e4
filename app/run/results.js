// Runs that are kept and compared, and a run as a file.
(() => {
  const { make, text, cells, send } = pgraph;

  // -- compare ----------------------------------------------------------------------------------------
  function build(host) {
    const keep = pgraph.button(
      "keep-run",
      "Keep run",
      "It is shown beside the next ones: in numbers, plots, and as a ghost in 3D",
      () => send("KeepRun"),
    );
    host.replaceChildren(
      keep,
      text("p", "muted hint", "Keep a run to compare it with the next."),
      make(
        "table",
        { className: "compared" },
        make(
          "thead",
          {},
          make(
            "tr",
            {},
            make("th"),
            ...["this run", "difference"].map((textContent) => make("th", { textContent })),
          ),
        ),
        make("tbody"),
      ),
    );
  }
  function draw(host, { compared: { kept, changed, rows }, continues }) {
    const $ = (selector) => host.querySelector(selector),
      line = $("thead tr");
    $(".keep-run").disabled = !continues;
    $(".hint").hidden = kept.length > 0;
    $(".compared").hidden = !kept.length;
    pgraph.keyed(
      line,
      kept.map((one) => ({ ...one, one })),
      column,
      (th, { one }) => {
        th.pgraphId = one.id;
        cells.set(th.querySelector(".cell"), one.name);
      },
    );
    line.append(...line.querySelectorAll("th:not(:first-child):not([data-name])"));
    // What all runs have in common stands below, once.
    const alike = (row) => new Set(row.slice(1, -1)).size === 1;
    const cellsOf = (row) =>
      alike(row)
        ? [
            make("td", { textContent: row[0] }),
            make("td", { textContent: row[1], colSpan: row.length - 1 }),
          ]
        : row.map((textContent) => make("td", { textContent }));
    const lines = (all, className) => all.map((row) => make("tr", { className }, ...cellsOf(row)));
    $("tbody").replaceChildren(
      ...lines(changed, "changed"),
      ...lines(
        rows.filter((row) => !alike(row)),
        "",
      ),
      ...lines(rows.filter(alike), "alike"),
    );
    pgraph.frame.count("Compare", kept.length);
  }
  // A kept run: its name, and a button that lets it go.
  function column() {
    const th = make("th"),
      name = cells.input(
        (serial, value) => send("NameRun", { serial, kept: th.pgraphId, text: value }),
        { label: "name of a kept run" },
      );
    th.append(
      make(
        "span",
        { className: "kept-run" },
        name,
        pgraph.pictureButton("bare", "close", "drop the run", "Keep it no longer", () =>
          send("DropRun", { kept: th.pgraphId }),
        ),
      ),
    );
    return th;
  }

  // -- export -----------------------------------------------------------------------------------------
  const FILES = [
    [
      "Share",
      "live",
      "Interactive figure",
      "A page that plays the run in any browser, in which the reader runs the model and changes its masses",
    ],
    [
      "Share",
      "fmu",
      "FMU (Simulink, Modelica, ...)",
      "The model with the scenario and steps of the run, for other simulators; they need no Python",
    ],
    ["Picture and film", "png", "Picture", "PNG of the pose shown, from the standard view"],
    ["Picture and film", "mp4", "Film", "MP4 of the run, which any player shows"],
    ["Picture and film", "gif", "GIF", "The run as a small film for slides and mails"],
    ["Numbers", "csv", "CSV", "Table of all numbers over time, for a spreadsheet"],
    [
      "Numbers",
      "npz",
      "NPZ",
      "The run with its model, to open in Python; with meshes a zip, to be unpacked first",
    ],
  ];
  const models = () => [
    ["", "Model as JSON", "With mesh files a zip of that and them"],
    ...(pgraph.latest.toolbar?.formats ?? []).map(([suffix, name]) => [
      suffix,
      `Model as ${name}`,
      "",
    ]),
  ];
  const runs = () => Boolean(pgraph.latest.run?.summary);
  const items = () => [
    [
      "Copy picture",
      "",
      () => pgraph.copyPicture(),
      { className: "copy-picture", about: "The view, the curves and the seal, to paste elsewhere" },
    ],
    ...(runs()
      ? FILES.flatMap(([group, what, label, about], i) => [
          ...(group === FILES[i - 1]?.[0] ? [] : [group]),
          [
            label,
            "",
            () => send("Export", { what }),
            { className: `export ${what === "live" ? "living" : what}`, about },
          ],
        ])
      : []),
    "Model",
    ...models().map(([suffix, label, about]) => [
      label,
      "",
      () => send("Download", suffix ? { suffix } : {}),
      { className: "model-file", about },
    ]),
  ];
  function exporter(host) {
    const open = make(
      "button",
      {
        className: "bare outlined exports",
        title: "The run as a page, a picture, a film or a table; the model as a file",
      },
      pgraph.icon("export"),
      text("span", "", "Export"),
    );
    const bar = make("progress", { max: 1 }),
      cancel = pgraph.button("cancel", "Cancel", "Stop making the file", () =>
        send("CancelExport"),
      );
    host.replaceChildren(
      make("span", { className: "making", hidden: true }, text("span", "", "Film"), bar, cancel),
      pgraph.menuButton(open, "export", items, { end: true }),
    );
  }
  function making(host, data) {
    host.querySelector(".making").hidden = data === null;
    if (data) host.querySelector("progress").value = data.fraction;
  }

  pgraph.commands("Export", () =>
    items()
      .filter(Array.isArray)
      .map(([label, , act, { about }]) => [`Export: ${label}`, "", act, about]),
  );
  pgraph.view("compare", { build, run: draw });
  pgraph.view("export", { build: exporter, making });
})();

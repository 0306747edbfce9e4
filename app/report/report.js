// Reports: error against run time and the stability map, with progress, figure and rows.
(() => {
  const { make, button, cells, send } = pgraph;

  function build(host) {
    const edit = (field) => (serial, value) => send("SetReport", { serial, field, text: value });
    const target = cells.input(edit("target"), { label: "error wanted", numeric: true });
    const t_end = cells.input(edit("t_end"), { label: "duration of the report", numeric: true });
    const axis = cells.choice(() => pgraph.latest.reports.axes, edit("axis"), { label: "axis" });
    t_end.placeholder = "all";
    host.pgraphCells = { target, t_end, axis };
    const field = (label, unit, cell, help) =>
      make(
        "div",
        { className: "field", title: help },
        make(
          "div",
          { className: "what" },
          make("span", { textContent: label }),
          make("span", { className: "unit", textContent: unit }),
        ),
        cell,
      );
    host.replaceChildren(
      make(
        "div",
        { className: "asks bar" },
        button(
          "precision",
          "Compare methods",
          "Runs this motion with every method at many settings and shows which one reaches the wanted error in the least time",
          () => send("Analyse", { kind: "precision" }),
        ),
        button(
          "stability",
          "Stability map",
          "Shows the step sizes at which each method stays accurate while one quantity of the model grows",
          () => send("Analyse", { kind: "stability" }),
        ),
      ),
      make(
        "details",
        {},
        make("summary", { textContent: "Settings" }),
        make(
          "div",
          { className: "report-settings" },
          field("Error goal", "", target, "The cheapest setting that reaches it is recommended"),
          field(
            "Duration",
            "s",
            t_end,
            "Length of the motion that is measured; empty: the whole run as simulated, of a map its first second",
          ),
          field("Map over", "", axis, "The quantity of the model that grows in the stability map"),
        ),
      ),
      make(
        "div",
        { className: "job", hidden: true },
        make("progress", { max: 1 }),
        make("span", { className: "said" }),
        button("cancel-report", "Cancel", "Stop, and keep what there is", () =>
          send("CancelAnalysis"),
        ),
      ),
      make("div", { className: "problem sentence", role: "alert", hidden: true }),
      make("div", { className: "outcomes" }),
    );
    pgraph.inSight(host, "reports");
  }

  // One report: its answer, figure, rows and notes.
  function outcome({ kind }) {
    return make(
      "div",
      { className: `outcome ${kind}` },
      make("strong", { className: "title" }),
      make("div", { className: "stale sentence" }),
      make("div", { className: "advice" }),
      make("div", { className: "bar use" }),
      make("div", {
        className: "figure",
        role: "button",
        tabIndex: 0,
        title: "Larger",
        onclick: (event) => enlarge(event.currentTarget),
        onkeydown: (event) => {
          if (event.key === "Enter") enlarge(event.currentTarget);
        },
      }),
      make(
        "details",
        { open: kind === "stability" },
        make("summary"),
        make("table", { className: "rows" }, make("thead"), make("tbody")),
      ),
      make("ul", { className: "notes muted" }),
    );
  }

  function enlarge(figure) {
    const picture = figure.firstElementChild?.cloneNode(true);
    if (picture) pgraph.dialog("Figure", "figure-large", picture);
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    const { target, t_end, axis } = host.pgraphCells;
    cells.set(target, data.target);
    cells.set(t_end, data.t_end ?? "");
    cells.choose(axis, data.axis);
    for (const ask of host.querySelectorAll(".asks button"))
      ask.disabled = data.job !== null || data.empty;
    $(".job").hidden = data.job === null;
    if (data.job) {
      $(".job progress").value = data.job.fraction;
      $(".job .said").textContent =
        `${Math.round(100 * data.job.fraction)} %${left(host, data.job)}`;
    }
    const ended = !data.job && host.pgraphBegan;
    if (!data.job) host.pgraphBegan = null;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    pgraph.keyed(
      $(".outcomes"),
      data.results.map((one) => ({ ...one, name: one.kind })),
      outcome,
      fill,
    );
    if (ended) host.pgraphShow = true;
    picture(host, pgraph.latest.figure ?? {});
  }

  // How long it will go on at its pace so far, where that is worth a word.
  function left(host, { fraction }) {
    const now = performance.now(),
      [at, first] = (host.pgraphBegan ??= [now, fraction]),
      done = fraction - first;
    const seconds = ((1 - fraction) * (now - at)) / 1e3 / done;
    if (now - at < 2e3 || !(done > 0)) return "";
    return seconds < 10
      ? `, about ${Math.ceil(seconds)} s left`
      : seconds < 90
        ? `, about ${Math.round(seconds / 10) * 10} s left`
        : seconds < 5400
          ? `, about ${Math.round(seconds / 60)} min left`
          : `, about ${Math.round(seconds / 3600)} h left`;
  }

  function fill(el, result) {
    const $ = (selector) => el.querySelector(selector);
    const row = (tag) => (entries) =>
      make("tr", {}, ...entries.map((textContent) => make(tag, { textContent })));
    $(".title").textContent = result.title;
    $(".advice").textContent = result.advice;
    const use = button("advised", "Use it", `Run with ${result.use} from now on`, () =>
      send("UseAdvised", { kind: result.kind }),
    );
    $(".use").replaceChildren(
      ...(result.use ? [use] : []),
      button("page", "Download", "The whole report as one HTML file", () =>
        send("DownloadReport", { kind: result.kind }),
      ),
    );
    $(".use").hidden = result.running;
    $(".stale").hidden = !result.stale;
    $(".stale").textContent = result.stale;
    $("details").hidden = !result.rows.length;
    $("summary").textContent = result.table;
    $(".rows thead").replaceChildren(row("th")(result.head));
    $(".rows tbody").replaceChildren(...result.rows.map(row("td")));
    $(".notes").replaceChildren(...result.notes.map((textContent) => make("li", { textContent })));
  }

  function picture(host, figures) {
    for (const [kind, svg] of Object.entries(figures)) {
      const figure = host.querySelector(`.outcome.${kind} .figure`);
      if (!figure || figure.pgraphDrawn === svg) continue;
      figure.pgraphDrawn = svg;
      const parsed = new DOMParser().parseFromString(
        svg || "<svg xmlns='http://www.w3.org/2000/svg'/>",
        "image/svg+xml",
      );
      for (const script of parsed.querySelectorAll("script")) script.remove();
      figure.replaceChildren(document.importNode(parsed.documentElement, true));
      if (host.pgraphShow) host.closest(".pane").scrollTop = 0;
      host.pgraphShow = false;
    }
  }

  pgraph.view("reports", { build, reports: draw, figure: picture });
})();

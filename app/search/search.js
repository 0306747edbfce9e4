// Searches: fits to measured curves, optimal numbers, and which number matters.
(() => {
  const { make, button, cells, send } = pgraph;
  const KINDS = [
    ["fit", "Fit to data"],
    ["optimise", "Optimise"],
    ["matters", "What matters"],
  ];
  const LARGEST = 20e6; // [bytes]
  const asked = () => pgraph.latest.search;
  const offered = () => pgraph.latest.choices;
  const signals = () => [["", "not used"], ...offered().signals.map((name) => [name, name])];
  const ways = () => offered().ways.map((name) => [name, name]);
  const short = (path) => path.replace(/^(bodies|forces)\./, "");
  const few = (x) => (x === null || x === "" ? "" : String(cells.digits(Number(x))));
  const unitOf = (path) => offered().numbers.find(({ name }) => name === path)?.unit ?? "";

  function build(host) {
    const kind = make(
      "select",
      {
        className: "cell",
        "aria-label": "kind of search",
        onchange: () => send("AskSearch", { kind: kind.value }),
      },
      ...KINDS.map(([value, textContent]) => make("option", { value, textContent })),
    );
    const file = make("input", {
      type: "file",
      accept: ".csv,text/csv",
      hidden: true,
      onchange: () => {
        read(file.files[0]);
        file.value = "";
      },
    });
    const way = cells.choice(
      ways,
      (serial, text) => send("SetGoal", { serial, field: "way", text }),
      { label: "way of the goal" },
    );
    const signal = cells.choice(
      signals,
      (serial, text) => send("SetGoal", { serial, field: "signal", text }),
      { label: "curve of the goal" },
    );
    const filter = make("input", {
      type: "text",
      className: "cell filter",
      placeholder: "Mass, damping…",
      title: "All numbers of the model, to be ticked",
      "aria-label": "numbers to find",
      onfocus: () => {
        host.pgraphAll = true;
        draw(host);
      },
      oninput: () => draw(host),
    });
    host.pgraphCells = { kind, way, signal, filter };
    const step = (title, ...parts) =>
      make(
        "section",
        { className: "step" },
        make("h4", { textContent: title }),
        make("div", {}, ...parts),
      );
    host.replaceChildren(
      make(
        "div",
        { className: "search-body" },
        make(
          "div",
          { className: "steps" },
          step(
            "Aim",
            make(
              "div",
              { className: "bar" },
              kind,
              button(
                "choose-data of-data",
                "Choose a CSV…",
                "Columns t and signals, or drop the file here",
                () => file.click(),
              ),
              file,
              make("span", { className: "muted file of-data" }),
            ),
            make("div", { className: "columns of-data" }),
            make(
              "div",
              { className: "bar of-goal" },
              make("span", { className: "muted goal-word", textContent: "Least" }),
              way,
              signal,
            ),
            make(
              "div",
              { className: "of-limits" },
              make("div", { className: "limits" }),
              button("add-limit", "Add a limit", "Bounds that the run keeps", () => {
                host.pgraphAdds = true;
                draw(host);
              }),
            ),
          ),
          step(
            "Numbers",
            make(
              "div",
              { className: "bar" },
              filter,
              make("span", {
                className: "waits muted",
                textContent: "Listing numbers and curves…",
              }),
            ),
            make("div", { className: "numbers" }),
          ),
          step(
            "Run",
            make(
              "div",
              { className: "bar" },
              button("start-search primary", "Start", "", () => send("StartSearch", {})),
              button("cancel-search", "Stop", "Stop, and keep the best numbers", () =>
                send("CancelSearch", {}),
              ),
              make("progress", { className: "busy" }),
              make("span", { className: "said muted" }),
            ),
            make("div", { className: "problem sentence", role: "alert", hidden: true }),
          ),
        ),
        make(
          "div",
          {},
          make("div", { className: "search-curves" }),
          make("div", { className: "search-result" }),
        ),
      ),
    );
    host.addEventListener("dragover", (event) => event.preventDefault());
    host.addEventListener("drop", (event) => {
      const dropped = event.dataTransfer?.files[0];
      if (!dropped || !/\.csv$/i.test(dropped.name)) return;
      event.preventDefault();
      event.stopPropagation();
      document.querySelector(".pgraph-drop")?.remove();
      read(dropped);
    });
    pgraph.inSight(host, "search");
  }

  async function read(file) {
    if (!file) return;
    if (file.size > LARGEST) {
      pgraph.toast(
        `${file.name} was not opened: it has ${(file.size / 1e6).toFixed(1)} MB; data have at most ${LARGEST / 1e6} MB.`,
      );
      return;
    }
    send("OpenData", { name: file.name, content: await file.text() });
  }

  // A column of the data and the signal that it measures.
  function column({ name }) {
    const cell = cells.choice(
      signals,
      (serial, text) => send("MatchColumn", { serial, column: name, text }),
      { label: `signal of ${name}` },
    );
    return Object.assign(
      make(
        "div",
        { className: "bar" },
        make("span", { className: "name", textContent: name }),
        cell,
      ),
      { pgraphCell: cell },
    );
  }

  function number({ name }) {
    const tick = make("input", {
      type: "checkbox",
      "aria-label": `${name} is free`,
      onchange: () => send("FreeNumber", { path: name, on: tick.checked }),
    });
    const bound = (end) =>
      cells.input((serial, text) => send("BoundNumber", { serial, path: name, end, text }), {
        label: `${end} bound of ${name}`,
        numeric: true,
      });
    const parts = {
      tick,
      low: bound("low"),
      high: bound("high"),
      value: make("span", { className: "value" }),
    };
    return Object.assign(
      make(
        "div",
        { className: "number" },
        make(
          "label",
          {},
          tick,
          make("span", { className: "name", title: name, textContent: short(name) }),
          make("span", { className: "unit", textContent: unitOf(name) }),
        ),
        parts.value,
        parts.low,
        parts.high,
      ),
      { parts },
    );
  }
  function fillNumber(el, one) {
    const { tick, low, high, value } = el.parts;
    const bounds = asked().free[one.name];
    tick.checked = Boolean(bounds);
    value.textContent = few(one.value);
    for (const [end, cell] of [low, high].entries()) {
      cell.hidden = !bounds || asked().kind === "matters";
      cells.set(cell, bounds?.[end] ?? "");
    }
  }

  function limit({ number }) {
    const set = (field) => (serial, text) => send("SetLimit", { serial, row: number, field, text });
    const parts = {
      way: cells.choice(ways, set("way"), { label: "way of the limit" }),
      signal: cells.choice(signals, set("signal"), { label: "curve of the limit" }),
      low: cells.input(set("low"), { label: "lower limit", numeric: true }),
      high: cells.input(set("high"), { label: "upper limit", numeric: true }),
    };
    return Object.assign(
      make(
        "div",
        { className: "number" },
        make("span", { className: "bar" }, parts.way, parts.signal),
        parts.low,
        parts.high,
      ),
      { parts },
    );
  }

  function draw(host) {
    const data = asked();
    if (!data || !offered()) return; // both come at once
    const $ = (selector) => host.querySelector(selector);
    const { kind, way, signal, filter } = host.pgraphCells;
    kind.value = data.kind;
    for (const one of host.querySelectorAll(".of-data")) one.hidden = data.kind !== "fit";
    $(".of-goal").hidden = data.kind === "fit";
    $(".of-limits").hidden = data.kind !== "optimise";
    way.hidden = data.kind === "matters";
    $(".goal-word").textContent = data.kind === "matters" ? "Curve" : "Least";
    $(".file").textContent = data.file;
    cells.choose(way, data.way);
    cells.choose(signal, data.signal);
    pgraph.keyed(
      $(".columns"),
      data.columns.map(([name, of]) => ({ name, of })),
      column,
      (el, { of }) => cells.choose(el.pgraphCell, of),
    );
    const limits = data.limits.map((given, number) => ({ name: `limit ${number}`, number, given }));
    if (host.pgraphAdds && limits.length === (host.pgraphCount ?? limits.length))
      limits.push({
        name: `limit ${limits.length}`,
        number: limits.length,
        given: ["peak", "", null, null],
      });
    else host.pgraphAdds = false;
    host.pgraphCount = data.limits.length;
    pgraph.keyed($(".limits"), limits, limit, (el, { given: [how, of, low, high] }) => {
      cells.choose(el.parts.way, how);
      cells.choose(el.parts.signal, of);
      cells.set(el.parts.low, low ?? "");
      cells.set(el.parts.high, high ?? "");
    });
    const word = filter.value.trim().toLowerCase();
    pgraph.keyed(
      $(".numbers"),
      offered().numbers.filter(
        ({ name }) => name in data.free || (host.pgraphAll && name.toLowerCase().includes(word)),
      ),
      number,
      fillNumber,
    );
    Object.assign($(".start-search"), {
      disabled: data.job !== null || Boolean(data.missing),
      hidden: data.job !== null,
      title: data.missing ? "" : "Search in the background",
    });
    $(".waits").hidden = !data.waits;
    $(".cancel-search").hidden = $(".busy").hidden = data.job === null;
    $(".said").textContent = data.job
      ? `${data.job.trials} runs${data.job.said ? `, ${data.job.said}` : ""}`
      : data.missing;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    $(".search-curves").replaceChildren(...data.curves.map(curve));
    const found = data.job ? null : data.found,
      shown = JSON.stringify(found);
    if (host.pgraphShown === shown) return; // its button may be pressed just now
    host.pgraphShown = shown;
    $(".search-result").replaceChildren(...(found ? [result(found)] : []));
  }

  // The data as dots, and the curve of the run that was tried last.
  function curve({ name, t, y, data }) {
    const measured = data.t.length ? [{ ...data, dots: true }] : [];
    return make(
      "figure",
      {},
      make("figcaption", { textContent: name }),
      pgraph.chart(
        `${name}: the run${measured.length ? " and the data" : ""}`,
        [...measured, { t, y }],
        false,
        true,
      ),
    );
  }

  function result({ kind, title, stale, rows, notes }) {
    const line = (tag, words) =>
      make("tr", {}, ...words.map((textContent) => make(tag, { textContent })));
    const bars = kind === "matters";
    const bar = (share) =>
      make(
        "td",
        { className: "share" },
        make("span", { style: `width:${Math.max(1, 100 * share)}%` }),
      );
    const body = rows.map(({ name, before, found, more, share }) => {
      const called = [short(name), unitOf(name)].filter(Boolean).join(" ");
      const row = bars
        ? line("td", [called, few(more)])
        : line("td", [
            called,
            few(before),
            few(found),
            ...(kind === "fit"
              ? [more === null ? "not determined" : `± ${Number(more.toPrecision(2))}`]
              : []),
          ]);
      if (bars) row.append(bar(share));
      return row;
    });
    return make(
      "div",
      { className: "outcome" },
      make(
        "div",
        { className: "bar" },
        make("strong", { className: "title", textContent: title }),
        make("span", { className: "spring" }),
        ...(bars
          ? []
          : [
              button(
                "use-found",
                "Use these numbers",
                "Put them into the model; Undo takes them back",
                () => send("UseFound", {}),
              ),
            ]),
      ),
      ...(stale ? [make("div", { className: "sentence", textContent: stale })] : []),
      make(
        "table",
        { className: "rows" },
        make(
          "thead",
          {},
          line(
            "th",
            bars
              ? ["number", "moves it by", ""]
              : ["number", "before", "found", ...(kind === "fit" ? ["error"] : [])],
          ),
        ),
        make("tbody", {}, ...body),
      ),
      make(
        "ul",
        { className: "notes muted" },
        ...notes.map((textContent) => make("li", { textContent })),
      ),
    );
  }

  pgraph.view("search", { build, choices: draw, search: draw });
})();

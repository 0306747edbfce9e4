// How far the run can be trusted: a seal, what it rests on, and what went wrong. All of the outcome
// is at the head of the accuracy report.
(() => {
  const { make, text, icon } = pgraph;
  const SIGNS = { good: "check", rough: "warn", unknown: "unknown", failed: "close", busy: "dots" };

  function build(host) {
    host.replaceChildren(
      make(
        "div",
        { className: "verdict" },
        text("span", "seal"),
        text("span", "said"),
        text("span", "spring"),
        make("button", {
          className: "link",
          textContent: "Report",
          title: "How the error was estimated, and how it depends on the step",
          onclick: () => pgraph.front("Accuracy"),
        }),
      ),
      make("progress", { max: 1, hidden: true }),
      text("p", "muted more"),
      make("dl", { className: "lines" }),
    );
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector),
      { level, said, why, lines, fraction, report, better } = data.trust;
    host.dataset.level = level;
    $(".seal").hidden = !level;
    $(".seal").replaceChildren(...(level ? [icon(SIGNS[level], 12)] : []));
    $(".said").textContent = said;
    $(".said").title = why || said;
    $(".link").hidden = !report;
    $(".more").hidden = !why || lines.length > 0; // the lines fill the foot: then the seal tells it when asked
    $(".more").textContent = $(".more").title = why;
    const bar = $("progress");
    bar.hidden = fraction === undefined;
    if (fraction === null || fraction === undefined) bar.removeAttribute("value");
    else bar.value = fraction;
    $(".lines").replaceChildren(
      ...lines.flatMap(([what, value, good, about]) => [
        make("dt", { textContent: what, title: about }),
        make("dd", { textContent: value, className: good ? "" : "bad", title: about }),
      ]),
      ...(better ? remedy(better) : []),
    );
  }

  // What to do about it: one press sets it and runs again.
  function remedy([label, field, text]) {
    const act = () => {
      pgraph.send("SetRun", { serial: pgraph.nextSerial(), field, text });
      pgraph.simulate();
    };
    return [
      make("dt", { textContent: "To improve" }),
      make(
        "dd",
        {},
        make("button", {
          className: "link",
          textContent: label,
          title: `Run again with ${text}`,
          onclick: act,
        }),
      ),
    ];
  }

  function outcome(host, data) {
    const line = (at) => (row) => [
      make("dt", { textContent: row[0] }),
      make("dd", { className: row[2] ? "" : "bad" }, ...folded(row[at])),
    ];
    host.hidden = data.summary === null;
    const key = JSON.stringify([data.summary, data.trust.lines]),
      told = new Set(data.trust.lines.map(([what]) => what));
    if (host.dataset.key === key) return;
    host.dataset.key = key;
    const lines = data.summary ?? [],
      fuller = lines.filter(([, brief, , whole]) => brief !== whole);
    host.replaceChildren(
      make(
        "dl",
        { className: "summary" },
        ...lines.filter(([what]) => !told.has(what)).flatMap(line(1)),
      ),
      make(
        "details",
        {},
        make("summary", { textContent: "Details" }),
        make("dl", { className: "summary" }, ...fuller.flatMap(line(3))),
      ),
    );
  }
  // A long list is one line until it is asked for.
  function folded(value) {
    const items = value.split("; ");
    if (items.length < 4) return [value];
    return [
      make(
        "details",
        {},
        make("summary", { textContent: `${items.length} in all` }),
        ...items.map((item) => make("div", { textContent: item })),
      ),
    ];
  }

  pgraph.view("trust", { build, run: draw });
  pgraph.view("outcome", { run: outcome });
})();

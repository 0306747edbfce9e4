// The run: what to simulate, its progress, its outcome, and what to do with it.
(() => {
  const { make, button, text, cells, send } = pgraph;
  const COMPARE = "Keep this run: the next one is shown next to it, in numbers and with this one as a ghost";
  const now = (event) => { document.activeElement?.blur(); send(event); };
  // With what stands in the settings, or not at all: what is being typed is taken first, what is refused is told.
  const asSet = (event) => {
    document.activeElement?.blur();
    const typed = [...document.querySelectorAll('[data-view="run"] .settings input.cell')];
    const go = (patience) => {
      if (patience && typed.some((cell) => cell.matches(".waiting"))) { setTimeout(go, 30, patience - 1); return; }
      const refused = typed.find((cell) => cell.matches(".refused"));
      if (!refused) { send(event); return; }
      pgraph.toast(`Nothing was simulated: the ${refused.ariaLabel} “${refused.value}” is refused. Correct it, or press Esc in its cell.`);
      refused.focus();
    };
    go(100);
  };

  function build(host) {
    host.replaceChildren(
      make("div", { className: "kernels", hidden: true }, text("span", "said"), make("progress", { max: 1 })),
      make("div", { className: "run" },
        settings(host),
        make("div", { className: "start" },
          button("primary simulate", "Simulate", "Run in the background", () => asSet("Simulate")),
          button("live", "Live", "Play while it computes: edit meanwhile, or pull a body with Ctrl and the mouse", () => asSet("GoLive"))),
        make("div", { className: "job", hidden: true }, make("progress", { max: 1 }), text("span", "said"),
          button("cancel", "Cancel", "Stop the simulation", () => send("Cancel"))),
        make("div", { className: "job lively", hidden: true }, text("span", "dot"), text("span", "said"),
          pgraph.pressButton("stop", "Stop", "End the live run and keep it", () => send("StopLive"))),
        make("div", { className: "problem sentence", role: "alert", hidden: true }),
        make("p", { className: "muted hint", hidden: true }),
        make("dl", { className: "summary", hidden: true }),
        make("table", { className: "compared", hidden: true }),
        after()));
  }

  function settings(host) {
    const edit = (field) => (serial, value) => send("SetRun", { serial, field, text: value });
    const scenario = cells.choice(() => pgraph.latest.run.scenarios, (serial, value) => send("SetScenario", { serial, scenario: value }), { label: "scenario" });
    const method = cells.choice(() => pgraph.latest.run.methods, edit("method"), { label: "method" });
    const number = (field, label) => cells.input(edit(field), { label, numeric: true });
    const t_end = number("t_end", "duration"), step = number("step", "step"), rtol = number("rtol", "tolerance");
    host.pgraphRun = { scenario, method, t_end, step, rtol };
    const field = (label, unit, cell, help) => make("div", { className: cell.tagName === "INPUT" ? "field" : "field wide", title: help },
      make("div", { className: "what" }, make("span", { textContent: label }), text("span", "unit", unit)), cell);
    return make("div", { className: "settings" },
      field("Scenario", "", scenario, "A run that the model describes, or a free one"),
      field("Method", "", method, "Integration method; automatic gives the reason for its choice"),
      make("div", { className: "numbers wide" },
        field("Duration", "s", t_end, "Length of the run"),
        field("Step", "s", step, ""), field("Tolerance", "", rtol, "")),
      make("p", { className: "muted kept wide", hidden: true }));
  }

  // What can be done with a finished run.
  function after() {
    // which to send: a line each says what it is for
    const files = [["html", "HTML", "A page that plays the run in 3D in any browser: to send"],
      ["live", "Living figure", "A page in which the reader runs the model, pulls on it and changes its masses"],
      ["png", "Picture", "PNG of the pose shown, from the standard view"], ["svg", "SVG", "The same for print: sharp at every size"],
      ["mp4", "Film", "MP4 of the run, which any player shows"], ["gif", "GIF", "The run as a small film for slides and mails"],
      ["csv", "CSV", "Table of all numbers over time, for a spreadsheet"], ["npz", "NPZ", "The run with its model, to open in Python"]];
    const list = make("div", { className: "chooser files", hidden: true });
    const open = button("offers", "Export …", "The run as a page, a picture, a film or a table", () => show(list.hidden));
    const show = (on) => {
      list.hidden = !on;
      open.setAttribute("aria-expanded", on);
      if (on) { list.scrollIntoView({ block: "nearest" }); list.querySelector("button").focus({ preventScroll: true }); }
    };
    show(false);
    list.append(...files.map(([what, label, about]) => make("button", {
      className: `export ${what === "live" ? "living" : what}`, "aria-label": label, title: about, onclick: () => { show(false); send("Export", { what }); },
    }, make("strong", { textContent: label }), make("span", { textContent: about }))));
    list.onkeydown = (event) => { if (event.key === "Escape") { show(false); open.focus(); event.stopPropagation(); } };
    return make("div", { className: "after", hidden: true },
      button("continue", "Continue", "Go on from the end for as long again", () => asSet("Continue")),
      button("pose", "Use pose", "The pose shown becomes the initial state of the model", () => now("UsePose")),
      button("ghost", "Compare", COMPARE, () => now("Compare")), open, list);
  }

  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector);
    const { scenario, method, t_end, step, rtol } = host.pgraphRun;
    cells.choose(scenario, data.request.scenario);
    cells.choose(method, data.request.method);
    cells.set(t_end, data.request.t_end);
    cells.set(step, data.request.step ?? "");
    cells.set(rtol, data.request.rtol ?? "");
    for (const [name, cell] of Object.entries({ step, rtol })) {
      const [hint, about, acts] = data.hints[name];
      cell.placeholder = hint;
      cell.closest(".field").title = about;
      cell.disabled = !acts;
    }
    $(".kept").hidden = !data.kept;
    $(".kept").textContent = data.kept;
    $(".kernels").hidden = data.kernels === null;
    if (data.kernels) {
      $(".kernels .said").textContent = data.kernels.text;
      progress($(".kernels progress"), data.kernels.fraction);
    }
    for (const act of ["simulate", "live"]) $(`.start .${act}`).disabled = data.empty;
    const over = data.live !== null && data.live.running === undefined; // stopped, and being joined
    $(".start").hidden = data.job !== null || (data.live !== null && !over);
    $(".job").hidden = data.job === null;
    if (data.job) {
      progress($(".job progress"), data.job.fraction);
      $(".job .said").textContent = data.job.text;
    }
    $(".lively").hidden = data.live === null;
    if (data.live) {
      $(".lively .said").textContent = data.live.text;
      $(".lively .dot").classList.toggle("on", data.live.running === true);
      $(".lively .stop").hidden = over;
    }
    $(".hint").hidden = data.empty || data.job !== null || data.live !== null || data.summary !== null || Boolean(data.problem);
    $(".hint").textContent = `Simulate computes ${data.request.t_end} s of motion and plays it. Live plays without an end, while you edit, pull and push.`;
    $(".problem").hidden = !data.problem;
    $(".problem").textContent = data.problem;
    outcome(host, data);
  }

  function outcome(host, data) {
    const $ = (selector) => host.querySelector(selector);
    const summary = $(".summary");
    summary.hidden = $(".after").hidden = data.summary === null;
    for (const which of ["continue", "pose", "ghost"]) $(`.${which}`).hidden = data.earlier && !data.ghost;
    const key = JSON.stringify(data.summary), same = summary.dataset.key === key;
    summary.dataset.key = key;
    if (!same) {
      const line = ([what, value, good]) => [make("dt", { textContent: what }), make("dd", { className: good ? "" : "bad", title: value }, folded(value))];
      const first = ([what, , good]) => FIRST.has(what) || !good, lines = data.summary ?? [], rest = lines.filter((one) => !first(one));
      const more = make("details", { open: summary.querySelector(".more")?.open ?? false, className: "more" }, make("summary", { textContent: "more" }), make("dl", {}, ...rest.flatMap(line)));
      summary.replaceChildren(...lines.filter(first).flatMap(line), ...(rest.length ? [more] : []));
    }
    const row = (tag) => (cells) => make("tr", {}, ...cells.map((textContent) => make(tag, { textContent })));
    $(".compared").hidden = !data.compared.length;
    $(".compared").replaceChildren(row("th")(["", "before", "this run"]), ...data.compared.map(row("td")));
    $(".ghost").textContent = data.ghost ? "No ghost" : "Compare";
    $(".ghost").title = data.ghost ? "Remove the ghost" : COMPARE;
    $(".ghost").setAttribute("aria-pressed", data.ghost);
    $(".ghost").classList.toggle("on", data.ghost);
  }

  // What is read first; the rest, unless it is bad, is unfolded.
  const FIRST = new Set(["This run is", "Status", "Method", "Error estimate", "Energy drift"]);

  // A long list is one line until it is asked for.
  function folded(text) {
    const items = text.split("; ");
    if (items.length < 4) return text;
    return make("details", {}, make("summary", { textContent: `${items.length} in all` }), ...items.map((item) => make("div", { textContent: item })));
  }

  function progress(bar, fraction) {
    bar.hidden = fraction !== null && fraction < 0;
    if (fraction === null) bar.removeAttribute("value");
    else bar.value = fraction;
  }

  pgraph.view("run", { build, run: draw });
})();

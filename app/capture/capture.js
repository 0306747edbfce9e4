// Motion capture: a trial, its markers and sites, scaling, the fit of the pose, and joint moments.
(() => {
  const { make, button, text, cells, send } = pgraph;
  const SUFFIXES = ".trc,.c3d,.mot,.sto,.csv";
  const now = () => pgraph.latest.capture;
  const few = (x) => (x === null || x === undefined ? "" : String(cells.digits(Number(x))));
  const tenths = (x) => (x === null ? "" : x.toFixed(1));
  const sites = () => [["", "–"], ...now().sites.map(({ name }) => [name, name])];

  function build(host) {
    const file = make("input", {
      type: "file",
      accept: SUFFIXES,
      hidden: true,
      onchange: () => {
        pgraph.files.trial(file.files[0]);
        file.value = "";
      },
    });
    const reading = (field, options, label) =>
      cells.choice(
        () => options,
        (serial, value) => send("SetReading", { serial, field, text: value }),
        { label },
      );
    const up = reading(
      "up",
      [["", "up: by the file"], ...["x", "y", "z"].map((x) => [x, `up: ${x}`])],
      "vertical axis of the trial",
    );
    const units = reading(
      "units",
      [["", "unit: of the file"], ...["m", "cm", "mm"].map((x) => [x, `unit: ${x}`])],
      "unit of the markers",
    );
    const mass = cells.input((serial, typed) => send("SetMass", { serial, text: typed }), {
      label: "mass of the person",
      numeric: true,
    });
    const cutoff = cells.input((serial, typed) => send("SetCutoff", { serial, text: typed }), {
      label: "cut-off of the filter",
      numeric: true,
    });
    const smooth = tick(
      "smooth",
      "Smooth the whole trial",
      "All frames at once, with a penalty on the jerk",
    );
    const band = tick(
      "band",
      "95 % band",
      "Of the moments of the motion itself, by the errors of markers",
    );
    host.pgraphCells = { up, units, mass, cutoff, smooth, band };
    host.replaceChildren(
      make(
        "div",
        { className: "capture-body" },
        make(
          "div",
          { className: "steps" },
          step(
            "Trial",
            bar(
              button(
                "choose-trial",
                "Open a trial…",
                "Markers, force plates or coordinates: TRC, C3D, MOT, STO or CSV; or drop the file here",
                () => file.click(),
              ),
              file,
              text("strong", "files"),
              text("span", "busy-reading muted", "Reading …"),
              button("show-trial of-trial", "Show", "Play the trial, and not the run", () =>
                send("ShowTrial"),
              ),
              button("close-trial of-trial", "Close", "Take the trial off the page", () =>
                send("CloseTrial"),
              ),
            ),
            text("div", "what muted of-trial"),
            make("div", { className: "bar of-trial" }, up, units),
            make("ul", { className: "report notes muted of-trial" }),
          ),
          step(
            "Scale",
            make("div", { className: "pairs" }),
            bar(
              button(
                "add-pair",
                "Add a pair",
                "Two sites of a body, whose distance scales it",
                () => {
                  host.pgraphAdds = true;
                  draw(host);
                },
              ),
              button(
                "propose-pairs",
                "Propose",
                "The two sites of each body that are farthest apart",
                () => send("ProposePairs"),
              ),
              text("span", "muted", "Mass"),
              mass,
              text("span", "muted", "kg"),
              button(
                "scale-model",
                "Scale",
                "Scale the model to the trial; Undo takes it back",
                () => send("ScaleModel"),
              ),
            ),
            text("div", "scaled muted"),
          ),
          step(
            "Pose",
            bar(
              button(
                "fit-pose primary",
                "Fit pose",
                "Find the motion that follows the markers",
                () => send("FitPose"),
              ),
              ...working("fit", "CancelFit"),
              smooth,
              button("export-fit", "CSV", "Coordinates and distances of markers over time", () =>
                send("ExportCapture", { what: "fit" }),
              ),
            ),
            text("div", "missing sentence"),
            problem("fit"),
            text("div", "fit-title"),
            text("div", "fit-stale sentence"),
            make("ul", { className: "fit-notes notes muted" }),
          ),
          step(
            "Moments",
            bar(
              button(
                "compute-moments primary",
                "Moments",
                "Joint moments of the motion, with the force plates",
                () => send("ComputeMoments"),
              ),
              ...working("moments", "CancelMoments"),
              text("span", "muted", "Cut-off"),
              cutoff,
              text("span", "muted", "Hz"),
              band,
              button("export-moments", "CSV", "Moments, bands and residuals over time", () =>
                send("ExportCapture", { what: "moments" }),
              ),
            ),
            make("div", { className: "plates" }),
            text("div", "no-band muted"),
            problem("moments"),
          ),
        ),
        make(
          "div",
          { className: "capture-found" },
          make("h4", { textContent: "Markers" }),
          text("div", "spare muted"),
          make(
            "div",
            { className: "sites" },
            make(
              "div",
              { className: "site head" },
              ...["site", "marker", "weight", "rms [mm]", "most [mm]"].map((x) =>
                text("span", "", x),
              ),
            ),
          ),
          make("div", { className: "fit-curve" }),
          make("div", { className: "capture-result" }),
        ),
      ),
    );
    pgraph.inSight(host, "capture");
  }
  const bar = (...parts) => make("div", { className: "bar" }, ...parts);
  const step = (title, ...parts) =>
    make(
      "section",
      { className: `step of-${title.toLowerCase()}` },
      make("h4", { textContent: title }),
      make("div", {}, ...parts),
    );
  const working = (of, cancel) => [
    make("progress", { className: `${of}-busy`, max: 1 }),
    text("span", `${of}-said muted`),
    button(`${of}-cancel`, "Cancel", "Stop the computation", () => send(cancel)),
  ];
  const problem = (of) =>
    make("div", { className: `${of}-problem sentence`, role: "alert", hidden: true });
  function tick(what, label, title) {
    const box = make("input", {
      type: "checkbox",
      onchange: () => send("SwitchCapture", { what, on: box.checked }),
    });
    return Object.assign(make("label", { className: "bar", title }, box, text("span", "", label)), {
      box,
    });
  }

  // A site with its marker, its weight and how far they are apart.
  function site({ name }) {
    const label = cells.choice(
      () => [["", "not used"], ...now().markers.map((x) => [x, x])],
      (serial, value) => send("MatchMarker", { serial, site: name, text: value }),
      { label: `marker of ${name}` },
    );
    const weight = cells.input(
      (serial, typed) => send("WeighMarker", { serial, site: name, text: typed }),
      { label: `weight of ${name}`, numeric: true },
    );
    const parts = {
      label,
      weight,
      rms: text("span", "value rms"),
      most: text("span", "value most"),
    };
    return Object.assign(
      make(
        "div",
        { className: "site" },
        make("span", { className: "name", title: name, textContent: name }),
        label,
        weight,
        parts.rms,
        parts.most,
      ),
      { parts },
    );
  }
  function fillSite(el, { label, weight, rms, most, largest }) {
    cells.choose(el.parts.label, label);
    cells.set(el.parts.weight, few(weight));
    el.parts.rms.textContent = tenths(rms);
    el.parts.most.textContent = tenths(most);
    const share = (100 * (rms ?? 0)) / (largest || 1);
    el.parts.rms.style.setProperty("--share", `${share}%`);
  }

  function pair({ number }) {
    const set = (field) => (serial, value) =>
      send("SetPair", { serial, row: number, field, text: value });
    const bodies = () => [["", "–"], ...now().bodies.map((x) => [x, x])];
    const parts = {
      body: cells.choice(bodies, set("body"), { label: "scaled body" }),
      one: cells.choice(sites, set("one"), { label: "from the site" }),
      other: cells.choice(sites, set("other"), { label: "to the site" }),
    };
    return Object.assign(make("div", { className: "pair" }, parts.body, parts.one, parts.other), {
      parts,
    });
  }

  function plate({ name }) {
    const cell = cells.choice(
      () => [["auto", "nearest body"], ["", "no body"], ...now().bodies.map((x) => [x, x])],
      (serial, value) => send("SetPlate", { serial, plate: name, text: value }),
      { label: `body of ${name}` },
    );
    return Object.assign(bar(text("span", "muted", name), cell), { cell });
  }

  function draw(host) {
    const data = now();
    if (!data) return;
    const $ = (selector) => host.querySelector(selector);
    const { take } = data;
    $(".busy-reading").hidden = !data.reading;
    for (const el of host.querySelectorAll(".of-trial .of-trial, .step:not(.of-trial)"))
      el.hidden = !take;
    $(".files").textContent = take ? take.files.join(" and ") : "";
    $(".choose-trial").textContent = take ? "Open another…" : "Open a trial…";
    if (!take) {
      $(".capture-result").replaceChildren();
      host.pgraphShown = null;
      return;
    }
    $(".show-trial").hidden = data.shown;
    $(".what").textContent = take.what;
    const { up, units, mass, cutoff, smooth, band } = host.pgraphCells;
    cells.choose(up, take.up);
    cells.choose(units, take.units);
    up.title = `${take.found_up} is up in the file`;
    list($(".report"), take.report);
    drawMarkers($, data);
    drawPairs(host, $, data);
    cells.set(mass, few(data.mass));
    mass.placeholder = few(data.total);
    $(".scaled").textContent = (data.scaled ?? []).join("\n");
    smooth.box.checked = data.fit.smooth;
    $(".fit-pose").disabled = Boolean(data.missing);
    $(".fit-pose").textContent = take.is_markers ? "Fit pose" : "Show the motion";
    $(".fit-pose").title = data.missing || "Find the motion that follows the markers";
    smooth.hidden = !take.is_markers;
    work($, "fit", ".fit-pose", data.fit);
    drawFit($, data.fit.found, take.is_markers);
    if (data.fit.found && !host.pgraphFitted) send("View", { which: "fit" });
    host.pgraphFitted = Boolean(data.fit.found);
    const { moments } = data;
    cells.set(cutoff, few(moments.cutoff));
    cutoff.placeholder = moments.usual;
    band.box.checked = moments.band;
    band.hidden = Boolean(moments.no_band);
    $(".no-band").textContent = moments.no_band;
    pgraph.keyed(
      $(".plates"),
      moments.plates.map(([name, body]) => ({ name, body })),
      plate,
      (el, { body }) => cells.choose(el.cell, body),
    );
    $(".compute-moments").disabled = !moments.ready;
    $(".compute-moments").title = moments.ready
      ? "Joint moments of the motion, with the force plates"
      : "Fit the pose of this model first";
    $(".export-moments").hidden = !moments.found;
    work($, "moments", ".compute-moments", moments);
    const shown = JSON.stringify(moments.found);
    if (host.pgraphShown === shown) return; // its charts stay as they are
    host.pgraphShown = shown;
    $(".capture-result").replaceChildren(...(moments.found ? result(moments.found) : []));
    mark(host);
  }
  const list = (box, sentences) =>
    box.replaceChildren(...sentences.map((textContent) => make("li", { textContent })));

  function drawMarkers($, data) {
    $(".missing").hidden = !data.missing;
    $(".missing").textContent = data.missing;
    $(".spare").textContent = data.spare ? `Markers without a site: ${data.spare}` : "";
    const largest = Math.max(0, ...data.sites.map(({ rms }) => rms ?? 0));
    pgraph.keyed(
      $(".sites"),
      data.sites.map((one) => ({ ...one, largest })),
      site,
      fillSite,
    );
  }
  function drawPairs(host, $, data) {
    const pairs = data.pairs.map((given, number) => ({ name: `pair ${number}`, number, given }));
    if (host.pgraphAdds && pairs.length === (host.pgraphCount ?? pairs.length))
      pairs.push({ name: `pair ${pairs.length}`, number: pairs.length, given: ["", "", ""] });
    else host.pgraphAdds = false;
    host.pgraphCount = data.pairs.length;
    pgraph.keyed($(".pairs"), pairs, pair, (el, { given: [body, one, other] }) => {
      cells.choose(el.parts.body, body);
      cells.choose(el.parts.one, one);
      cells.choose(el.parts.other, other);
    });
    $(".scale-model").disabled = !data.pairs.some((one) => one.every(Boolean));
  }
  function work($, of, go, { job, problem: said }) {
    $(go).hidden = job !== null;
    for (const part of ["busy", "said", "cancel"]) $(`.${of}-${part}`).hidden = job === null;
    const busy = $(`.${of}-busy`);
    if (job?.fraction) busy.value = job.fraction;
    else busy.removeAttribute("value");
    $(`.${of}-said`).textContent = job?.text ?? "";
    $(`.${of}-problem`).hidden = !said;
    $(`.${of}-problem`).textContent = said;
  }
  function drawFit($, found, markers) {
    $(".export-fit").hidden = !found || !markers;
    $(".fit-title").textContent = found?.title ?? "";
    $(".fit-stale").hidden = !found?.stale;
    $(".fit-stale").textContent = found?.stale ?? "";
    list($(".fit-notes"), found?.notes ?? []);
    const said = "Distance of the markers, rms of each frame, mm";
    $(".fit-curve").replaceChildren(
      ...(found?.t.length > 1
        ? [text("div", "muted", said), pgraph.chart(said, [{ t: found.t, y: found.rms }], true)]
        : []),
    );
  }

  function result({ title, stale, t, curves, notes }) {
    const list = make("ul", { className: "notes muted" });
    list.replaceChildren(...notes.map((textContent) => make("li", { textContent })));
    return [
      text("strong", "title", title),
      ...(stale ? [text("div", "sentence", stale)] : []),
      make(
        "div",
        { className: "capture-curves" },
        ...curves.map(({ name, unit, y, low, high }) =>
          make(
            "figure",
            {},
            make("figcaption", { textContent: `${name}, ${unit}` }),
            pgraph.chart(
              `${name}, ${unit}${low ? ", with its 95 % band" : ""}`,
              [{ t, y, ...(low ? { low, high } : {}) }],
              true,
            ),
          ),
        ),
      ),
      list,
    ];
  }
  function mark(host) {
    const moment = pgraph.latest.time ?? pgraph.latest.playback?.moment;
    if (!moment || !now()?.shown) return;
    for (const chart of host.querySelectorAll("svg.line-chart")) chart.pgraphMark([moment[0], NaN]);
  }

  pgraph.view("capture", { build, capture: draw, time: mark });
  pgraph.commands("Capture", () => [
    [
      "Open a trial of motion capture",
      "",
      () => pgraph.front("Capture"),
      "markers and force plates",
    ],
    ...(now()?.take
      ? [
          ["Fit the pose to the markers", "", () => send("FitPose")],
          ["Compute joint moments", "", () => send("ComputeMoments")],
          ["Close the trial", "", () => send("CloseTrial")],
        ]
      : []),
  ]);
})();

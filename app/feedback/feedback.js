// State feedback by LQR or pole placement: a dialog with what is allowed, the gains, the closed loop, and one button.
pgraph.feedback = (() => {
  const { make, send, text, forms } = pgraph;
  let box = null;

  function open() {
    const form = make("div", { className: "form" }),
      found = text("div", "found"),
      add = make("button", {
        className: "action primary add-feedback",
        textContent: "Add to the model",
        title: "The drives follow it from now on; Undo takes it back",
        onclick: () => send("AddFeedback"),
      });
    box = pgraph.dialog(
      "State feedback",
      "pgraph-feedback",
      make("div", { className: "both" }, form, found),
      make("div", { className: "bar" }, text("span", "spring"), add),
    );
    box.addEventListener("close", () => {
      box = null;
      send("CloseFeedback");
    });
    send("OpenFeedback");
  }
  const ask = {
    edit: (field, entries, serial) => send("EditFeedback", { serial, field, entries }),
  };
  const digits = (x) => Number(x.toPrecision(5));

  pgraph.on("feedback", (data) => {
    if (!box) return;
    if (!data) {
      box.close();
      return;
    }
    const [form, found] = box.querySelector(".both").children;
    forms.draw(form, data.groups, ask, "feedback");
    box.querySelector(".add-feedback").disabled = data.busy || !data.gains;
    found.classList.toggle("busy", data.busy);
    const head = (names) =>
      make(
        "thead",
        {},
        make("tr", {}, ...["", ...names].map((textContent) => make("th", { textContent }))),
      );
    const row = ({ name, gains }) =>
      make(
        "tr",
        {},
        make("th", { textContent: name }),
        ...gains.map((x) => make("td", { textContent: digits(x), title: x })),
      );
    found.replaceChildren(
      ...(data.problem
        ? [make("div", { className: "sentence", role: "alert", textContent: data.problem })]
        : []),
      ...(!data.gains && data.busy ? [text("p", "muted", "Computing …")] : []),
      ...(data.gains
        ? [
            text("h4", "", "Gains"),
            make(
              "div",
              { className: "gains" },
              make(
                "table",
                {},
                head(data.gains.states),
                make("tbody", {}, ...data.gains.rows.map(row)),
              ),
            ),
            text("h4", "", data.stable ? "Closed loop, stable" : "Closed loop, not stable"),
            text("div", "poles", `${data.poles.join(", ")} 1/s`),
            text("div", "muted", `holds ${data.hold}`),
            ...chart(data.curves),
          ]
        : []),
    );
  });

  // Responses over time, each as a part of the largest that is allowed.
  function chart(curves, title) {
    if (!curves.length) return [];
    const lines = curves.map(([, t, y], i) => ({ t, y, style: `stroke: var(--s${i % 8})` }));
    return [
      text("h4", "", title ?? "Response to a step, each as a part of the largest"),
      pgraph.chart("response to a step", lines, true),
      make(
        "div",
        { className: "legend muted" },
        ...curves.map(([name], i) => {
          const one = text("span", "", name);
          one.style.setProperty("--hue", `var(--s${i % 8})`);
          return one;
        }),
      ),
    ];
  }

  pgraph.commands("Model", [
    [
      "State feedback: LQR, pole placement",
      "",
      open,
      "gains from the linearised motion at the pose shown",
    ],
  ]);

  // The response of a controller's signal and value to a step of its setpoint.
  let asked = null;
  function step(name) {
    asked = pgraph.dialog(`Step response of ${name}`, "pgraph-feedback", text("div", "found"));
    asked.addEventListener("close", () => {
      asked = null;
    });
    send("AskResponse", { name });
  }
  pgraph.on("response", ({ busy, problem, curves, size, texts }) => {
    asked
      ?.querySelector(".found")
      .replaceChildren(
        ...(busy
          ? [text("p", "muted", "Computing …")]
          : problem
            ? [make("div", { className: "sentence", role: "alert", textContent: problem })]
            : [
                ...curves.flatMap((one, i) =>
                  chart([one], `Change of ${one[0]}${i ? "" : ` over the step of ${size}`}`).slice(
                    0,
                    2,
                  ),
                ),
                ...texts.map((one) => text("div", "response", one)),
              ]),
      );
  });
  return { open, step };
})();

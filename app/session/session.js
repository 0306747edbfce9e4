// The page's own buttons: its theme, and help.
(() => {
  const { send } = pgraph;
  const dark = () => Boolean(pgraph.latest.theme?.dark),
    turn = () => send("Theme", { dark: !dark() });
  function build(host) {
    host.replaceChildren(
      pgraph.pictureButton("bare theme", "dark", "Dark or light", "Dark or light", turn),
      pgraph.pictureButton(
        "bare keys",
        "help",
        "Keyboard shortcuts",
        "Keyboard shortcuts (?)",
        () => pgraph.shortcuts.open(),
      ),
      pgraph.pictureButton(
        "bare sheet-toggle",
        "side",
        "selection panel",
        "Selection (Ctrl I)",
        () => pgraph.frame.toggle("right"),
      ),
    );
  }
  function draw(host) {
    host.querySelector(".theme svg").replaceWith(pgraph.icon(dark() ? "light" : "dark"));
  }
  pgraph.commands("Bodies", () =>
    (pgraph.latest.table?.rows ?? []).map(({ name, joint, parent }) => [
      name,
      "",
      () => send("Select", { body: name }),
      `${joint} joint to ${parent}`,
    ]),
  );
  pgraph.commands("Page", [
    ["Dark or light", "", turn],
    ["Keyboard shortcuts", "?", () => pgraph.shortcuts.open()],
    ...[
      "Bodies",
      "Connections",
      "Scenarios",
      "Plots",
      "Accuracy",
      "Fit",
      "Matrices",
      "Events",
      "Compare",
    ].map((tab) => [`Show ${tab.toLowerCase()}`, "", () => pgraph.front(tab)]),
    ["Stability map", "", () => pgraph.front("Accuracy"), "which methods hold where"],
    ["Show or hide the model", "Ctrl B", () => pgraph.frame.toggle("left")],
    ["Show or hide the selection", "Ctrl I", () => pgraph.frame.toggle("right")],
  ]);
  pgraph.view("session", { build, theme: draw });
})();

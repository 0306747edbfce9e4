// Two runs compared, and a run as a file.
(() => {
  const { make, text, send } = pgraph;
  const COMPARE = "Keep this run: the next one is shown beside it, in numbers and as a ghost in 3D";

  // -- compare ----------------------------------------------------------------------------------------
  function build(host) {
    host.replaceChildren(pgraph.button("ghost", "Compare", COMPARE, () => { document.activeElement?.blur(); send("Compare"); }), text("p", "muted hint"), make("table", { className: "compared" }));
  }
  function draw(host, data) {
    const $ = (selector) => host.querySelector(selector), row = (tag) => (cells) => make("tr", {}, ...cells.map((textContent) => make(tag, { textContent })));
    $(".ghost").textContent = data.ghost ? "Remove the kept run" : "Keep this run";
    $(".ghost").title = data.ghost ? "Remove the ghost" : COMPARE;
    $(".ghost").disabled = !data.ghost && (data.summary === null || data.stale);
    $(".ghost").setAttribute("aria-pressed", data.ghost);
    $(".hint").hidden = data.compared.length > 0;
    $(".hint").textContent = data.ghost ? "Change something and play again: both runs are compared here." : "Keep a run, change something, play again: both runs are compared here.";
    $(".compared").hidden = !data.compared.length;
    $(".compared").replaceChildren(row("th")(["", "kept run", "this run"]), ...data.compared.map(row("td")));
    pgraph.frame.count("Compare", data.ghost ? 1 : 0);
  }

  // -- export -----------------------------------------------------------------------------------------
  const FILES = [["html", "HTML", "A page that plays the run in 3D in any browser"], ["live", "Interactive figure", "A page in which the reader runs the model and changes its masses"],
    ["png", "Picture", "PNG of the pose shown, from the standard view"], ["svg", "SVG", "The same for print: sharp at every size"],
    ["mp4", "Film", "MP4 of the run, which any player shows"], ["gif", "GIF", "The run as a small film for slides and mails"],
    ["csv", "CSV", "Table of all numbers over time, for a spreadsheet"], ["npz", "NPZ", "The run with its model, to open in Python; with meshes a zip, to be unpacked first"]];
  const MODELS = [["", "Model as JSON", "With mesh files a zip of that and them"], [".urdf", "Model as URDF", ""], [".xml", "Model as MJCF", ""]];
  const runs = () => Boolean(pgraph.latest.run?.summary);
  const items = () => [
    ...(runs() ? [...FILES.map(([what, label, about]) => [label, "", () => send("Export", { what }), { className: `export ${what === "live" ? "living" : what}`, about }]), null] : []),
    ...MODELS.map(([suffix, label, about]) => [label, "", () => send("Download", suffix ? { suffix } : {}), { className: "model-file", about }])];
  function exporter(host) {
    const open = make("button", { className: "bare outlined exports", title: "The run as a page, a picture, a film or a table; the model as a file" }, pgraph.icon("export"), text("span", "", "Export"));
    const bar = make("progress", { max: 1 }), cancel = pgraph.button("cancel", "Cancel", "Stop making the file", () => send("CancelExport"));
    host.replaceChildren(make("span", { className: "making", hidden: true }, text("span", "", "Film"), bar, cancel), pgraph.menuButton(open, "export", items, { end: true }));
  }
  function making(host, data) {
    host.querySelector(".making").hidden = data === null;
    if (data) host.querySelector("progress").value = data.fraction;
  }

  pgraph.commands("Export", () => items().filter(Boolean).map(([label, , act, { about }]) => [`Export: ${label}`, "", act, about]));
  pgraph.view("compare", { build, run: draw });
  pgraph.view("export", { build: exporter, making });
})();

// Files: a model or a zip of one dropped anywhere on the page is opened, a trial of motion capture is
// laid over the model, a mesh becomes the shape of the selected bodies; the questions of toolbar and properties read files the same way.
pgraph.files = (() => {
  const LARGEST = { json: 8e6, zip: 12e6, mesh: 10e6, step: 15e6 }; // [bytes]
  const TRIAL = /\.(trc|c3d|mot|sto|csv)$/i;
  const MESH = /\.(stl|obj|ply|off|glb|dae)$/i;
  let over = null,
    archive = null; // what a drop brings; the last zip that was sent

  // The file's content by `how` ("text", or "base64"); undefined, and a sentence, where there is none.
  async function content(file, kind, how, what) {
    const most = LARGEST[kind],
      refuse = (why) => pgraph.toast(`${file.name} was not opened: ${why}`);
    if (file.size > most)
      return refuse(
        `it has ${(file.size / 1e6).toFixed(1)} MB; ${what} has at most ${most / 1e6} MB.`,
      );
    try {
      return await (how === "text" ? file.text() : base64(file));
    } catch {
      return refuse("it could not be read.");
    }
  }
  const base64 = (file) =>
    new Promise((done, failed) => {
      const reader = new FileReader();
      reader.onload = () => done(reader.result.split(",", 2)[1] ?? "");
      reader.onerror = failed;
      reader.readAsDataURL(file);
    });

  async function read(file) {
    if (!file) return;
    if (MESH.test(file.name)) {
      mesh(file, pgraph.latest.selected ?? []);
      return;
    }
    if (TRIAL.test(file.name)) {
      trial(file);
      return;
    }
    if (/\.(step|stp)$/i.test(file.name)) {
      const text = await content(file, "step", "text", "a STEP file");
      if (text !== undefined) pgraph.send("OpenAssembly", { name: file.name, content: text });
      return;
    }
    const zip = /\.zip$/i.test(file.name);
    const found = await (zip
      ? content(file, "zip", "base64", "a model with its meshes")
      : content(file, "json", "text", "a model file"));
    if (found === undefined) return;
    const sent = { name: file.name, content: found };
    if (zip) archive = sent;
    pgraph.send(zip ? "OpenArchive" : "OpenText", sent);
  }
  const member = (file, name) => {
    if (archive?.name === file) pgraph.send("OpenArchive", { ...archive, member: name });
  };

  async function trial(file) {
    const found = await content(file, "zip", "base64", "a trial");
    if (found === undefined) return;
    pgraph.front("Capture");
    pgraph.send("OpenTrial", { name: file.name, content: found });
  }

  async function mesh(file, bodies) {
    if (!bodies.length) {
      pgraph.toast(`${file.name} was not opened: select the body first whose shape it is.`);
      return;
    }
    const found = await content(file, "mesh", "base64", "a mesh file");
    if (found !== undefined) pgraph.send("UploadMesh", { bodies, name: file.name, content: found });
  }

  const brings = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  function hint(on) {
    if (!on) {
      over?.remove();
      over = null;
      return;
    }
    over ??= document.body.appendChild(
      pgraph.make("div", {
        className: "pgraph pgraph-drop",
        textContent:
          "Drop a model to open it, a trial of motion capture, or a mesh for the selected body",
      }),
    );
  }
  window.addEventListener("dragover", (event) => {
    if (brings(event)) {
      event.preventDefault();
      hint(true);
    }
  });
  window.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) hint(false);
  });
  window.addEventListener("drop", (event) => {
    hint(false);
    if (!brings(event)) return;
    event.preventDefault();
    const files = [...event.dataTransfer.files];
    if (files.length > 1) {
      pgraph.toast(
        `${files.length} files were dropped; one is opened at a time. Drop a model and its mesh files as one .zip.`,
      );
      return;
    }
    read(files[0]);
  });
  return { read, mesh, member, trial };
})();

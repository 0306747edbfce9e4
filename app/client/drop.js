// A file dropped anywhere on the page is opened; the toolbar's own question reads files the same way.
pgraph.files = (() => {
  const LARGEST = 8_000_000; // [bytes]
  let over = null;

  async function read(file) {
    if (!file) return;
    if (file.size > LARGEST) {
      pgraph.toast(`${file.name} was not opened: it has ${(file.size / 1e6).toFixed(1)} MB; a model file has at most 8 MB.`);
      return;
    }
    try {
      pgraph.send("OpenText", { name: file.name, content: await file.text() });
    } catch {
      pgraph.toast(`${file.name} was not opened: it could not be read.`);
    }
  }

  const brings = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  function hint(on) {
    if (!on) { over?.remove(); over = null; return; }
    over ??= document.body.appendChild(pgraph.make("div", { className: "pgraph pgraph-drop", textContent: "Drop a model file to open it" }));
  }
  window.addEventListener("dragover", (event) => { if (brings(event)) { event.preventDefault(); hint(true); } });
  window.addEventListener("dragleave", (event) => { if (!event.relatedTarget) hint(false); });
  window.addEventListener("drop", (event) => {
    hint(false);
    if (!brings(event)) return;
    event.preventDefault();
    const files = [...event.dataTransfer.files];
    if (files.length > 1) { pgraph.toast(`${files.length} files were dropped; one model is opened at a time.`); return; }
    read(files[0]);
  });
  return { read };
})();

// What has a <title> is said at once beside the pointer, not after the browser's pause.
const said = document.createElement("div");
said.id = "said";
said.hidden = true;
said.setAttribute("role", "status");
document.body.append(said);
for (const title of document.querySelectorAll("svg title")) {
  const mark = title.parentElement;
  const text = title.textContent;
  mark.setAttribute("aria-label", text);
  title.remove();
  const show = (x, y) => {
    said.textContent = text;
    said.hidden = false;
    const left = Math.min(x + 14, innerWidth - said.offsetWidth - 8);
    const top = Math.min(y + 14, innerHeight - said.offsetHeight - 8);
    said.style.left = `${Math.max(8, left)}px`;
    said.style.top = `${Math.max(8, top)}px`;
  };
  mark.addEventListener("pointermove", (e) => show(e.clientX, e.clientY));
  mark.addEventListener("pointerleave", () => { said.hidden = true; });
  mark.addEventListener("focus", () => {
    const box = mark.getBoundingClientRect();
    show(box.right, box.bottom);
  });
  mark.addEventListener("blur", () => { said.hidden = true; });
}

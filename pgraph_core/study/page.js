// Shows the <title> of an element at once next to the pointer, not after the browser's delay.
const tip = document.createElement("div");
tip.id = "tip";
tip.hidden = true;
tip.setAttribute("role", "status");
document.body.append(tip);
for (const title of document.querySelectorAll("svg title")) {
  const mark = title.parentElement;
  const text = title.textContent;
  mark.setAttribute("aria-label", text);
  title.remove();
  const show = (x, y) => {
    tip.textContent = text;
    tip.hidden = false;
    const left = Math.min(x + 14, innerWidth - tip.offsetWidth - 8);
    const top = Math.min(y + 14, innerHeight - tip.offsetHeight - 8);
    tip.style.left = `${Math.max(8, left)}px`;
    tip.style.top = `${Math.max(8, top)}px`;
  };
  mark.addEventListener("pointermove", (e) => show(e.clientX, e.clientY));
  mark.addEventListener("pointerleave", () => { tip.hidden = true; });
  mark.addEventListener("focus", () => {
    const box = mark.getBoundingClientRect();
    show(box.right, box.bottom);
  });
  mark.addEventListener("blur", () => { tip.hidden = true; });
}

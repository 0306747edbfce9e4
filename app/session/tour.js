// A tour of five steps, for who sees the page for the first time; it can be left at any step.
pgraph.tour = (() => {
  const { make } = pgraph;
  const SEEN = "pgraph tour seen";
  const STEPS = [
    ["button.play", "Play", "Press Play: the motion is computed, then shown. The slider goes to any time."],
    ["canvas:not(.pgraph *)", "Look around", "Drag to turn the view, use the wheel to come nearer, press F to see all. Click a body to select it."],
    ["table.bodies", "The bodies", "One row a body: its name, its parent, its joint. Type into a cell; Ctrl+Z takes back every edit."],
    ['[data-view="digraph"]', "The tree", "The same bodies as a tree. Drag a node onto another to hang it there."],
    ["button.new", "Your own model", "New asks how many bodies; Open has examples with pictures. Ctrl+K finds every command, ? lists the keys."],
  ];
  let card = null, at = 0;

  function seen() { try { return localStorage.getItem(SEEN); } catch { return "1"; } }
  function end() {
    card?.remove();
    card = null;
    try { localStorage.setItem(SEEN, "1"); } catch { /* a private window: it is offered again */ }
  }
  function step(k) {
    at = k;
    if (at >= STEPS.length) { end(); return; }
    const [where, title, text] = STEPS[at];
    card?.remove();
    const button = (label, onclick, primary = "") => make("button", { className: `action ${primary}`, textContent: label, onclick });
    card = make("div", { className: "pgraph pgraph-tour", role: "dialog", "aria-label": `tour, step ${at + 1} of ${STEPS.length}` },
      make("strong", { textContent: title }), make("p", { textContent: text }),
      make("div", { className: "bar" }, make("span", { className: "muted", textContent: `${at + 1} of ${STEPS.length}` }), make("span", { className: "spring" }),
        button("Skip", end), button(at + 1 < STEPS.length ? "Next" : "Done", () => step(at + 1), "primary")));
    card.addEventListener("keydown", (event) => { if (event.key === "Escape") { event.stopPropagation(); end(); } });
    document.body.append(card);
    place(document.querySelector(where));
    card.querySelector(".primary").focus();
  }
  // Beside what it is about, within the window.
  function place(target) {
    const box = target?.getBoundingClientRect(), { offsetWidth: w, offsetHeight: h } = card;
    if (!box) return;
    const inside = (x, most) => Math.min(Math.max(x, 10), Math.max(most - 10, 10));
    const large = box.width > innerWidth / 3 && box.height > innerHeight / 3;
    const aside = box.left > innerWidth / 2 ? box.left - w - 12 : box.right + 12;
    card.style.left = `${inside(large ? box.left + (box.width - w) / 2 : box.width > 400 ? box.right + 12 : aside, innerWidth - w)}px`;
    card.style.top = `${inside(large ? box.top + 24 : box.top < innerHeight / 2 ? box.top : box.top - h - 12, innerHeight - h)}px`;
  }
  // Offered once to a person, not to a program that drives the page.
  if (!seen() && !navigator.webdriver) {
    const wait = setInterval(() => { if (document.querySelector("button.play")) { clearInterval(wait); step(0); } }, 400);
  }
  return { start: () => step(0) };
})();

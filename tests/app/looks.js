// What a critical eye looks for on the page, as sentences: panels over one another, text that is
// cut off without saying so elsewhere, text too faint or too small to read. Called with the
// smallest contrast and the smallest size of letters [px].
([least, small]) => {
  const found = [],
    contrasts = [];
  const shown = (el) =>
    el.checkVisibility({ opacityProperty: true, visibilityProperty: true }) &&
    el.getClientRects().length > 0;
  const short = (text) => JSON.stringify(text.trim().slice(0, 60));

  // -- panels ----------------------------------------------------------------------------------
  const panels = [
    ...document.querySelectorAll(".pgraph-slot:is(.top, .left, .right, .drawer), .pgraph-foot"),
  ].filter(shown);
  const boxes = panels.map((el) => [el.innerText.split("\n")[0], el.getBoundingClientRect()]);
  const overlap = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  boxes.forEach(([name, box], i) => {
    if (box.left < -1 || box.top < -1 || box.right > innerWidth + 1 || box.bottom > innerHeight + 1)
      found.push(`panel ${name} leaves the window`);
    for (const [other, its] of boxes.slice(i + 1))
      if (overlap(box, its)) found.push(`panels ${name} and ${other} overlap`);
  });
  for (const el of document.querySelectorAll(".pgraph-slot .pane, .pgraph-slot.right")) {
    const wider = el.scrollWidth - el.clientWidth;
    if (wider > 1)
      found.push(`what is in ${short(el.innerText)} is ${wider} px wider than its panel`);
  }
  if (document.documentElement.scrollWidth > innerWidth)
    found.push("the page is wider than its window");

  // -- text that is cut off: what is elided says it in a title ---------------------------------
  const hosts = [...document.querySelectorAll(".pgraph, [role=tab]")].filter(shown);
  const within = hosts.flatMap((host) => [host, ...host.querySelectorAll("*")]).filter(shown);
  const all = new Set(within.filter((el) => el instanceof HTMLElement)),
    drawn = new Set(within.filter((el) => el instanceof SVGTextElement));
  const own = (el) =>
    [...el.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim());
  const clips = (el) => getComputedStyle(el).overflowX !== "visible";
  const words = (el) =>
    el.matches("input")
      ? el.value
      : el.matches("select")
        ? (el.selectedOptions[0]?.textContent ?? "")
        : el.textContent;
  const titled = (el) => el.closest("[title]:not([title=''])") !== null;
  const pen = document.createElement("canvas").getContext("2d");
  function wide(el) {
    // the text of a field, which may not scroll in it
    const style = getComputedStyle(el);
    pen.font = style.font;
    const room = el.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
    return pen.measureText(words(el)).width > room + 1;
  }
  for (const el of all) {
    if (el.matches("input:is([type=text], [type=search], :not([type])), select")) {
      if (wide(el) && !titled(el))
        found.push(`the field ${el.getAttribute("aria-label")} cuts ${short(words(el))}`);
    } else if (own(el) && clips(el) && el.scrollWidth > el.clientWidth + 1 && !titled(el)) {
      found.push(`${short(words(el))} is cut off`);
    } else if (own(el) && el.closest(".pgraph")) {
      // beyond the sides of what holds it, where that does not scroll
      const box = el.getBoundingClientRect(),
        holder = el.closest(".pgraph").getBoundingClientRect();
      const scrolls = [...ancestors(el)].some(
        (one) =>
          ["auto", "scroll"].includes(getComputedStyle(one).overflowX) && one.closest(".pgraph"),
      );
      if (!scrolls && (box.left < holder.left - 1 || box.right > holder.right + 1) && !titled(el))
        found.push(`${short(words(el))} leaves its panel`);
    }
  }
  function* ancestors(el) {
    for (let at = el; at; at = at.parentElement) yield at;
  }

  // -- contrast, as WCAG 2.2 reckons it ----------------------------------------------------------
  const parsed = (text) => {
    const n = text.match(/[\d.]+/g).map(Number);
    return text.startsWith("color(")
      ? [...n.slice(0, 3).map((x) => 255 * x), n[3] ?? 1]
      : [...n.slice(0, 3), n[3] ?? 1];
  };
  const over = (top, below) => top.slice(0, 3).map((c, i) => c * top[3] + below[i] * (1 - top[3]));
  const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
  const light = (rgb) =>
    0.2126 * linear(rgb[0]) + 0.7152 * linear(rgb[1]) + 0.0722 * linear(rgb[2]);
  const dark = document.documentElement.dataset.mantineColorScheme === "dark";
  function paper(el) {
    let below = dark ? [20, 24, 30] : [255, 255, 255];
    for (const one of [...ancestors(el)].reverse())
      if (one instanceof HTMLElement)
        below = over(parsed(getComputedStyle(one).backgroundColor), below);
    const disc = el.closest("g")?.querySelector("circle:not(.outer)"); // a number stands on its node
    const [text, round] = [el, disc].map((one) => one?.getBoundingClientRect());
    const on = drawn.has(el) && disc && text.left >= round.left && text.right <= round.right;
    return on ? over(parsed(getComputedStyle(disc).fill), below) : below;
  }
  const faint = (el) =>
    [...ancestors(el)].reduce((product, one) => product * Number(getComputedStyle(one).opacity), 1);
  const idle = (el) => el.closest(":disabled, [aria-disabled=true]") !== null; // exempt, as in WCAG
  for (const el of [...all, ...drawn]) {
    if (
      (!own(el) && !el.matches("input:not([type=range], [type=checkbox]), select")) ||
      idle(el) ||
      !words(el).trim()
    )
      continue;
    const style = getComputedStyle(el),
      below = paper(el),
      ink = parsed(drawn.has(el) ? style.fill : style.color);
    const size =
      parseFloat(style.fontSize) *
      (drawn.has(el) ? Math.hypot(el.getScreenCTM().a, el.getScreenCTM().b) : 1);
    if (size < small) found.push(`${short(words(el))} is ${size.toFixed(1)} px high`);
    const seen = over([...ink.slice(0, 3), ink[3] * faint(el)], below);
    const [low, high] = [light(seen), light(below)].sort((a, b) => a - b),
      ratio = (high + 0.05) / (low + 0.05);
    contrasts.push(ratio);
    if (ratio < least) found.push(`${short(words(el))} has a contrast of ${ratio.toFixed(2)}`);
  }
  return { faults: [...new Set(found)], texts: contrasts.length, contrast: Math.min(...contrasts) };
};

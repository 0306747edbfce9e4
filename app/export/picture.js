// A picture of what the page shows: the 3D view, the lanes of the feet, the curves in sight and the
// seal of the run, one below the other.
(() => {
  const MARGIN = 16, // of the page, as all lengths here [px]
    LINE = 20,
    DASH = 18, // of a legend, with the gap behind it
    GAP = 14,
    SIGNS = { good: "✓", rough: "!", unknown: "?", failed: "✕", busy: "…" },
    look = () => getComputedStyle(document.querySelector(".pgraph")),
    font = (weight, size) => `${weight} ${size}px ${look().fontFamily}`,
    colour = (name) => look().getPropertyValue(name).trim();

  const seen = (one) => Boolean(one?.clientWidth) && one.checkVisibility();
  const first = (selector) => [...document.querySelectorAll(selector)].find(seen);

  // Parts of the picture, from top to bottom: [height, draw(g, y)].
  function parts(width) {
    const view = window.__viserMutable.canvas,
      { clientWidth, clientHeight } = view,
      high = (width * clientHeight) / clientWidth;
    return [
      [high, (g) => sight(g, view, width, high)],
      [MARGIN + LINE, (g, y) => caption(g, y + MARGIN, width)],
      ...lanes(width),
      ...[...document.querySelectorAll(".pgraph figure.plot")].filter(seen).flatMap(curves(width)),
      [MARGIN, () => {}],
    ];
  }

  // The 3D view with its labels, which are elements of the page above it.
  function sight(g, view, width, high) {
    const at = view.getBoundingClientRect();
    g.drawImage(view, 0, 0, width, high);
    g.textAlign = "center";
    for (const pill of [...document.querySelectorAll(".pgraph-pill")].filter(seen)) {
      const own = pill.getBoundingClientRect(),
        style = getComputedStyle(pill),
        [x, y] = [own.x - at.x, own.y - at.y];
      g.fillStyle = style.backgroundColor;
      g.beginPath();
      g.roundRect(x, y, own.width, own.height, own.height / 2);
      g.fill();
      put(g, pill.textContent, x + own.width / 2, y + own.height / 2 + 4, style.color, style.font);
    }
    g.textAlign = "left";
  }

  function caption(g, y, width) {
    const { name, count } = pgraph.latest.toolbar,
      trust = pgraph.latest.run?.trust,
      at = first(".pgraph .transport .time")?.textContent ?? "",
      end = put(g, name, MARGIN, y, colour("--ink"), font(600, 15));
    put(g, trust?.level ? at : count, end + 12, y, colour("--ink-3"), font(400, 13));
    if (!trust?.level) return;
    const style = getComputedStyle(document.querySelector(".pgraph .verdict"));
    g.textAlign = "right";
    put(g, `${SIGNS[trust.level]} ${trust.said}`, width - MARGIN, y, style.color, font(500, 13));
    g.textAlign = "left";
  }

  function lanes(width) {
    const feet = first(".pgraph .feet"),
      bars = feet?.querySelector("canvas");
    if (!seen(bars)) return [];
    const box = feet.getBoundingClientRect(),
      scale = (width - 2 * MARGIN) / box.width;
    return [
      [
        box.height * scale + MARGIN,
        (g, y) => {
          const within = (one) => {
            const own = one.getBoundingClientRect();
            return [MARGIN + (own.x - box.x) * scale, y + (own.y - box.y) * scale, own];
          };
          for (const name of feet.querySelectorAll(".names > div")) {
            const [x, top, own] = within(name);
            put(
              g,
              name.textContent,
              x,
              top + own.height * scale * 0.5 + 4,
              colour("--ink-2"),
              font(400, 11),
            );
          }
          const [x, top, own] = within(bars);
          g.drawImage(bars, x, top, own.width * scale, own.height * scale);
        },
      ],
    ];
  }

  const curves = (width) => (figure) => {
    const canvas = figure.querySelector("canvas.chart"),
      wide = width - 2 * MARGIN,
      high = (wide * canvas.clientHeight) / canvas.clientWidth;
    if (!seen(canvas)) return [];
    const title = figure.querySelector("figcaption strong").textContent,
      unit = figure.querySelector("figcaption .unit").textContent,
      entries = [...figure.querySelectorAll(".legend .entry")].map((one) => [
        one.textContent.trim(),
        one.querySelector(".dash")?.style.borderTopColor,
      ]),
      face = font(400, 12),
      rows = wrapped(entries, wide, face);
    const head = (g, y) => {
      const end = put(g, capital(title), MARGIN, y + LINE / 2, colour("--ink"), font(600, 13));
      put(g, unit, end + 8, y + LINE / 2, colour("--ink-3"), face);
      for (const [k, row] of rows.entries()) {
        let x = MARGIN;
        for (const [said, tone] of row) {
          const below = y + (k + 1.5) * LINE;
          g.fillStyle = tone ?? "transparent";
          g.fillRect(x, below - 5, DASH - 4, 2);
          x = put(g, said, x + (tone ? DASH : 0), below, colour("--ink-2"), face) + GAP;
        }
      }
    };
    return [
      [LINE * (rows.length + 1), head],
      [high + 8, (g, y) => g.drawImage(canvas, MARGIN, y, wide, high)],
    ];
  };
  const capital = (said) => said.charAt(0).toUpperCase() + said.slice(1);

  // Entries of a legend in rows that are as wide as the picture.
  function wrapped(entries, wide, face) {
    const g = pgraph.pen(document.createElement("canvas")),
      rows = [];
    let left = 0;
    g.font = face;
    for (const entry of entries) {
      const own = g.measureText(entry[0]).width + DASH + GAP;
      if (own > left) {
        rows.push([]);
        left = wide;
      }
      rows.at(-1).push(entry);
      left -= own;
    }
    return rows;
  }

  // Write a text, and return where it ends.
  function put(g, text, x, y, tone, face) {
    g.fillStyle = tone;
    g.font = face;
    g.fillText(text, x, y);
    return x + g.measureText(text).width;
  }
  // The picture as a canvas, with as many pixels as the 3D view has.
  function picture() {
    const view = window.__viserMutable.canvas,
      width = view.clientWidth,
      scale = view.width / width,
      all = parts(width),
      height = all.reduce((sum, [high]) => sum + high, 0),
      canvas = pgraph.make("canvas", { width: view.width, height: Math.round(height * scale) }),
      g = pgraph.pen(canvas);
    g.scale(scale, scale);
    g.fillStyle = colour("--paper");
    g.fillRect(0, 0, width, height);
    let y = 0;
    for (const [high, draw] of all) {
      draw(g, y);
      y += high;
    }
    return canvas;
  }

  pgraph.copyPicture = () => {
    const blob = new Promise((done) => picture().toBlob(done, "image/png"));
    const saved = async () => {
      const name = pgraph.latest.toolbar.name.replace(/[^\w-]+/g, "_"),
        href = URL.createObjectURL(await blob);
      pgraph.make("a", { href, download: `${name}.png` }).click();
      URL.revokeObjectURL(href);
      pgraph.toast(
        "The browser keeps the clipboard closed here: the picture was downloaded.",
        true,
      );
    };
    // the item takes a promise, since a browser gives the clipboard at once or not at all
    if (!navigator.clipboard?.write) return saved();
    const item = new ClipboardItem({ "image/png": blob });
    return navigator.clipboard
      .write([item])
      .then(() => pgraph.toast("Copied a picture of the view and the curves.", true), saved);
  };
})();

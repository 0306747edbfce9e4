// An element of a drawing.
pgraph.svg = (tag, attributes = {}, ...children) => {
  const el = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) el.setAttribute(key, value);
  el.append(...children);
  return el;
};
// Lines over one axis, each {t, y, style, dots} and, with a band about it, {low, high}, in a picture that is as wide as its place; `zero`: the axis is in it.
// The ends of both axes stand next to it with `axes`, in the `unit` of what is over it.
// Its `pgraphMark` shows where something is now, on the axis [t] or at a point [t, y], or takes the mark away.
pgraph.chart = (label, lines, zero = false, axes = zero, unit = " s") => {
  const W = 1000,
    H = 1000,
    all = lines
      .flatMap(({ y, low, high }) => [...y, ...(low ?? []), ...(high ?? [])])
      .concat(zero ? [0] : []),
    times = lines.flatMap(({ t }) => [t[0], t.at(-1)]);
  const [bottom, top, first, last] = [
      Math.min(...all),
      Math.max(...all),
      Math.min(...times),
      Math.max(...times),
    ],
    // rounding is not blown up, nor what a numerical slope leaves of it
    blur = Math.max(0, 1e-9 * Math.max(Math.abs(bottom), Math.abs(top)) - (top - bottom)),
    [low, high] = [bottom - blur, top + blur];
  const at = (t, y) =>
    `${((W * (t - first)) / (last - first || 1)).toFixed(1)},${(0.97 * H - (0.94 * H * (y - low)) / (high - low || 1)).toFixed(1)}`;
  const line = ({ t, y, style = "", dots = false }) =>
    pgraph.svg("path", {
      class: dots ? "dots" : "line",
      style,
      d: t.map((x, i) => `${dots || !i ? "M" : "L"}${at(x, y[i])}${dots ? "h0" : ""}`).join(""),
    });
  const band = ({ t, low: under, high: over }) =>
    pgraph.svg("path", {
      class: "band",
      d: `M${[...t.map((x, i) => at(x, over[i])), ...t.map((x, i) => at(x, under[i])).reverse()].join("L")}Z`,
    });
  const picture = pgraph.svg(
    "svg",
    {
      class: "line-chart",
      viewBox: `0 0 ${W} ${H}`,
      preserveAspectRatio: "none",
      role: "img",
      "aria-label": label,
    },
    ...(zero ? [pgraph.svg("path", { class: "zero", d: `M${at(first, 0)}L${at(last, 0)}` })] : []),
    ...lines.filter((one) => one.low).map(band),
    ...lines.map(line),
  );
  picture.pgraphMark = (now) => {
    for (const old of picture.querySelectorAll(".now")) old.remove();
    if (!now || !(now[0] >= first && now[0] <= last)) return;
    const [t, y] = now,
      x = at(t, 0).split(",")[0],
      inside = y >= low - 0.03 * (high - low) && y <= high + 0.03 * (high - low);
    picture.append(pgraph.svg("path", { class: "now", d: `M${x},0V${H}` }));
    if (inside) picture.append(pgraph.svg("path", { class: "now dots", d: `M${at(t, y)}h0` }));
  };
  // less than a point of the picture is 0
  const digits = (x, span) => (Math.abs(x) < span / W ? 0 : Number(x.toPrecision(3)));
  const end = (className, x, span, unit = "") =>
    pgraph.text("span", className, `${digits(x, span)}${unit}`);
  return axes
    ? pgraph.make(
        "div",
        { className: "axed muted" },
        end("", top, top - bottom),
        picture,
        blur ? pgraph.text("span", "low", "") : end("low", bottom, top - bottom),
        end("first", first, last - first),
        end("last", last, last - first, unit),
      )
    : picture;
};

// One family of icons: 16 px, lines of 1.5 px with round ends; `play`, `pause` and `stop` are filled.
(() => {
  const FILLED = {
    play: "M4.5 2.6v10.8a.7.7 0 0 0 1.07.6l8.5-5.4a.7.7 0 0 0 0-1.2L5.57 2a.7.7 0 0 0-1.07.6z",
    dots: "M2 8a1.3 1.3 0 1 0 2.6 0a1.3 1.3 0 1 0-2.6 0M6.7 8a1.3 1.3 0 1 0 2.6 0a1.3 1.3 0 1 0-2.6 0M11.4 8a1.3 1.3 0 1 0 2.6 0a1.3 1.3 0 1 0-2.6 0",
    pause: "M4 3h2.6v10H4zM9.4 3H12v10H9.4z",
    stop: "M4 4h8v8H4z",
  };
  const LINES = {
    add: "M8 3v10M3 8h10",
    check: "M3.5 8.5l3 3 6-7",
    close: "M4 4l8 8M12 4l-8 8",
    down: "M4 6l4 4 4-4",
    right: "M6 4l4 4-4 4",
    up: "M4 10l4-4 4 4",
    start: "M4 3.5v9M12 3.8v8.4L6 8z",
    less: "M10 4L6 8l4 4",
    more: "M6 4l4 4-4 4",
    loop: "M3 7.5A5 5 0 0 1 12.4 6M13 8.5A5 5 0 0 1 3.6 10M12.6 3v3h-3M3.4 13v-3h3",
    undo: "M6 3L3 6l3 3M3 6h6.5a3.5 3.5 0 0 1 0 7H7",
    redo: "M10 3l3 3-3 3M13 6H6.5a3.5 3.5 0 0 0 0 7H9",
    search: "M7 3a4 4 0 1 0 0 8a4 4 0 1 0 0-8M10.2 10.2L13 13",
    export: "M8 10V2.5M5 5l3-3 3 3M3 9.5V13h10V9.5",
    dark: "M13 9.5A5.5 5.5 0 1 1 6.5 3a4.5 4.5 0 0 0 6.5 6.5z",
    help: "M8 2a6 6 0 1 0 0 12A6 6 0 1 0 8 2M6.3 6.3a1.8 1.8 0 1 1 2.4 1.8c-.5.2-.7.5-.7 1.1M8 11.3v.1",
    light:
      "M8 5.2a2.8 2.8 0 1 0 0 5.6a2.8 2.8 0 1 0 0-5.6M8 1.5v1.2M8 13.3v1.2M1.5 8h1.2M13.3 8h1.2M3.4 3.4l.9.9M11.7 11.7l.9.9M12.6 3.4l-.9.9M4.3 11.7l-.9.9",
    graph:
      "M8 1.8a1.7 1.7 0 1 0 0 3.4a1.7 1.7 0 1 0 0-3.4M4 10.8a1.7 1.7 0 1 0 0 3.4a1.7 1.7 0 1 0 0-3.4M12 10.8a1.7 1.7 0 1 0 0 3.4a1.7 1.7 0 1 0 0-3.4M8 5.2v1.3c0 2.3-4 1.6-4 4.3M8 6.5c0 2.3 4 1.6 4 4.3",
    folder: "M2 12.5v-9h4.5l1.5 2h6v7z",
    sliders:
      "M2.5 5h6M12 5h1.5M2.5 11H5M8.5 11h5M10.2 3.3a1.7 1.7 0 1 0 0 3.4a1.7 1.7 0 1 0 0-3.4M6.7 9.3a1.7 1.7 0 1 0 0 3.4a1.7 1.7 0 1 0 0-3.4",
    spectrum: "M2.5 13.5h11M4 13.5v-4M6.5 13.5v-10M9 13.5v-6M11.5 13.5v-2.5",
    plots: "M2.5 2.5v11h11M5 10l2.5-3 2 1.5L13 4.5",
    warn: "M8 2.5l6 10.5H2zM8 6.5v3M8 11.3v.1",
    unknown: "M5.8 6a2.2 2.2 0 1 1 3.2 2c-.7.4-1 .8-1 1.6M8 12.2v.1",
    revolute:
      "M8 6.4a1.6 1.6 0 1 0 0 3.2a1.6 1.6 0 1 0 0-3.2M13 8A5 5 0 1 1 8 3M8 3l2-1.5M8 3l2 1.5",
    universal: "M8 6a2 2 0 1 0 0 4a2 2 0 1 0 0-4M8 1.5V6M8 10v4.5M1.5 8H6M10 8h4.5",
    free: "M8 1.8a6.2 6.2 0 1 0 0 12.4A6.2 6.2 0 1 0 8 1.8M8 8V2.5M8 8l4.8 3M8 8l-4.8 3",
    weld: "M3 3h10v10H3zM3 3l10 10M13 3L3 13",
    prismatic: "M2 5h12M2 11h12M4.5 8h7M9.5 6l2 2-2 2",
    spherical: "M8 4.5a3.5 3.5 0 1 0 0 7a3.5 3.5 0 1 0 0-7M8 1.5v3M3 13l2.5-2.5M13 13l-2.5-2.5",
    beam: "M2.5 3v10M2.5 6.2c5 0 8.5 1 11 4.6M2.5 9.2c4.5 0 7 .8 9 3.6",
    compound: "M8 5.5a2.5 2.5 0 1 0 0 5a2.5 2.5 0 1 0 0-5M2.5 8a5.5 5.5 0 1 1 11 0",
    large: "M9.5 2.5h4v4M13.5 2.5L9 7M6.5 13.5h-4v-4M2.5 13.5L7 9",
    small: "M13 7H9V3M9 7l4.5-4.5M3 9h4v4M7 9l-4.5 4.5",
    eye: "M1.5 8S4 3.5 8 3.5 14.5 8 14.5 8 12 12.5 8 12.5 1.5 8 1.5 8zM8 6.100a1.9 1.9 0 1 0 0 3.800a1.9 1.9 0 1 0 0-3.8",
    cursor: "M4 3l8.5 4.3-3.7 1.2-1.5 3.800z",
    move: "M8 2v12M2 8h12M8 2L6.5 3.5M8 2l1.5 1.5M8 14l-1.5-1.5M8 14l1.5-1.5M2 8l1.5-1.5M2 8l1.5 1.5M14 8l-1.5-1.5M14 8l-1.5 1.5",
    ruler: "M2 11l9-9 3 3-9 9zM5 8l1.5 1.5M7.5 5.5L9 7",
    fit: "M2.5 6V3.5a1 1 0 0 1 1-1H6M10 2.5h2.5a1 1 0 0 1 1 1V6M13.5 10v2.5a1 1 0 0 1-1 1H10M6 13.5H3.5a1 1 0 0 1-1-1V10",
    duplicate: "M5.5 5.5h8v8h-8zM3 10.5H2.5v-8h8V3",
    mirror: "M8 2v12M6 4v8L2 12zM10 4v8l4 0z",
    delete: "M3 4.5h10M6.5 4.5v-2h3v2M4.5 4.5l.6 9h5.800l.6-9M7 7v4M9 7v4",
    pick: "M8 1.5v3M8 11.5v3M1.5 8h3M11.5 8h3M8 6a2 2 0 1 0 0 4a2 2 0 1 0 0-4",
    left: "M2.5 3h11v10h-11zM6.5 3v10",
    side: "M2.5 3h11v10h-11zM9.5 3v10",
  };
  pgraph.icon = (name, size = 16) => {
    const filled = name in FILLED;
    return pgraph.svg(
      "svg",
      {
        viewBox: "0 0 16 16",
        width: size,
        height: size,
        class: filled ? "icon filled" : "icon",
        "aria-hidden": "true",
      },
      pgraph.svg("path", { d: filled ? FILLED[name] : LINES[name] }),
    );
  };
})();

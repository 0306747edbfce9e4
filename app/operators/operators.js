// The Operators tab: one operator as a picture of its cells; values under the pointer.
(() => {
  const { make, send } = pgraph;
  let what = "M";

  function build(host) {
    const kind = make("div", { className: "kind", role: "toolbar", "aria-label": "operator" });
    const canvas = make("canvas", {
      className: "cells",
      role: "img",
      "aria-label": "pattern of the operator",
    });
    const files = pgraph.menuButton(
      pgraph.pictureButton("bare files", "export", "download", "The matrix as a file"),
      "files",
      () =>
        [
          ["NPZ", "npz", "for scipy.sparse.load_npz"],
          ["CSV", "csv", ""],
          ["Matrix Market", "mtx", ""],
        ].map(([name, suffix, about]) => [
          name,
          "",
          () => send("ExportOperator", { what, suffix }),
          { about },
        ]),
      { end: true },
    );
    host.replaceChildren(
      make(
        "div",
        { className: "bar" },
        kind,
        make("button", {
          className: "action whole",
          textContent: "Whole",
          title: "All rows and columns",
          onclick: look,
        }),
        files,
        make("div", { className: "value", role: "status", title: "Equations of the paper" }),
        make(
          "div",
          { className: "scale", title: "Six decades, from the largest value down to faint" },
          make("span"),
          make("i"),
          make("span"),
        ),
      ),
      make("div", { className: "sentence problem" }),
      canvas,
    );
    canvas.addEventListener("pointermove", (event) => told(host, event));
    canvas.addEventListener("pointerleave", () => describe(host));
    canvas.addEventListener("click", (event) => closer(host, event));
    const seen = new ResizeObserver(() => paint(host));
    for (const box of [host, pane(host)]) seen.observe(box);
    pgraph.whileVisible(host, (on) => {
      if (on) look();
      else send("Inspect", { what: "", rows: null, columns: null });
    });
  }
  const pane = (host) => host.closest(".pane");
  const look = () => send("Inspect", { what, rows: null, columns: null });

  function draw(host, data) {
    const kind = host.querySelector(".kind");
    if (!kind.children.length)
      kind.append(
        ...Object.entries(data.titles).map(([value, [symbol, title]]) =>
          make("button", {
            className: "chip-button",
            textContent: symbol,
            title,
            value,
            onclick: () => {
              what = value;
              look();
            },
          }),
        ),
      );
    what = data.what;
    for (const one of kind.children) one.setAttribute("aria-pressed", one.value === what);
    host.operator = data;
    host.querySelector(".problem").textContent = data.problem;
    host.querySelector("canvas").hidden = Boolean(data.problem);
    host.querySelector(".whole").hidden =
      Boolean(data.problem) ||
      (data.rows[1] - data.rows[0] === data.shape[0] &&
        data.columns[1] - data.columns[0] === data.shape[1]);
    host.found = new Map((data.cells ?? []).map(([i, j, x]) => [`${i} ${j}`, x]));
    paint(host);
    describe(host);
  }

  const sides = (data) => [
    Math.ceil((data.rows[1] - data.rows[0]) / data.step[0]),
    Math.ceil((data.columns[1] - data.columns[0]) / data.step[1]),
  ];

  function paint(host) {
    const data = host.operator,
      canvas = host.querySelector("canvas");
    if (!data || data.problem) return;
    const [n, m] = sides(data),
      style = getComputedStyle(host),
      [edge, left, right] = (host.edge = edges(style, data)),
      { paddingTop, paddingBottom } = getComputedStyle(pane(host)); // its end fades there
    const high =
      pane(host).clientHeight -
      parseFloat(paddingTop) -
      parseFloat(paddingBottom) -
      (canvas.getBoundingClientRect().top - host.getBoundingClientRect().top);
    const wide = Math.max(host.clientWidth - 24, 100) - left - right; // all of it in the pane, where that is large enough
    host.size = Math.max(
      2,
      Math.min(wide / Math.max(m, 1), Math.max(high - edge, 100) / Math.max(n, 1), 40),
    );
    const ratio = window.devicePixelRatio || 1,
      w = host.size * m + left + right,
      h = host.size * n + edge;
    canvas.style.width = `${w}px`;
    canvas.style.height = `${h}px`;
    canvas.width = Math.max(1, Math.round(w * ratio));
    canvas.height = Math.max(1, Math.round(h * ratio));
    const pen = pgraph.pen(canvas),
      most = Math.max(...data.cells.map(([, , x]) => Math.abs(x)), 1e-300);
    pen.scale(ratio, ratio);
    names(pen, style, host.size, host.edge, data);
    pen.translate(left, edge);
    pen.fillStyle = style.getPropertyValue("--hover");
    pen.fillRect(0, 0, w - left - right, h - edge);
    const gap = host.size > 6 ? 0.5 : 0;
    for (const [i, j, x] of data.cells) {
      // six decades from the largest down to faint
      pen.globalAlpha = Math.max(0.15, 1 + Math.log10(Math.abs(x) / most) / 6);
      pen.fillStyle = x < 0 ? style.getPropertyValue("--minus") : style.getPropertyValue("--plus");
      pen.fillRect(
        j * host.size + gap,
        i * host.size + gap,
        host.size - 2 * gap,
        host.size - 2 * gap,
      );
    }
    pen.globalAlpha = 1;
    const [least, , greatest] = host.querySelector(".scale").children,
      largest = Number(most.toPrecision(2));
    least.textContent = `−${largest}`;
    greatest.textContent = `${largest}`;
    // the rows and columns of the selected bodies
    pen.strokeStyle = style.getPropertyValue("--accent");
    pen.lineWidth = 1.5;
    const chosen = selected(),
      band = (numbers, step, draw) =>
        numbers.forEach((number, k) => {
          if (!chosen.has(number) || numbers[k - 1] === number) return;
          const from = Math.floor(k / step),
            last = Math.floor(numbers.lastIndexOf(number) / step);
          draw(host.size * from, host.size * (last - from + 1));
        });
    band(data.row_numbers, data.step[0], (from, size) =>
      pen.strokeRect(0.75, from, w - left - right - 1.5, size),
    );
    band(data.column_numbers, data.step[1], (from, size) =>
      pen.strokeRect(from, 0.75, size, h - edge - 1.5),
    );
  }
  const selected = () =>
    new Set((pgraph.latest.selected ?? []).map((name) => pgraph.table.row(name)?.number));

  const letters = (style) => ({
    font: `10px ${style.fontFamily}`,
    textAlign: "center",
    textBaseline: "middle",
  });

  // The height above the cells and the widths to the left and right of them, where their marks are.
  function edges(style, data) {
    const pen = Object.assign(new OffscreenCanvas(1, 1).getContext("2d"), letters(style));
    const width = (mark) => pen.measureText(mark ?? "").width,
      widest = Math.max(...[...new Set(data.row_numbers)].map(width), 0);
    return [
      17,
      Math.max(17, Math.ceil(widest) + 6),
      Math.ceil(width(data.column_numbers.at(-1)) / 2),
    ];
  }

  // The numbers of the bodies at the left and at the top; those that would run into the one before are left out.
  function names(pen, style, size, edge, data) {
    Object.assign(pen, letters(style));
    const chosen = selected();
    [
      [data.column_numbers, data.step[1], 8],
      [data.row_numbers, data.step[0], 1],
    ].forEach(([numbers, step, room], side) => {
      let free = 0;
      for (let k = 0; k < numbers.length;) {
        let last = k;
        while (numbers[last + 1] === numbers[k]) last += 1;
        const middle = edge[side ? 0 : 1] + (size * (k + last + 1)) / 2 / step,
          half = side ? 5 : (pen.measureText(numbers[k]).width + room) / 2 - 2;
        if (middle - half >= free) {
          pen.fillStyle = style.getPropertyValue(chosen.has(numbers[k]) ? "--accent" : "--soft");
          pen.fillText(numbers[k], side ? edge[1] / 2 - 1 : middle, side ? middle : edge[0] / 2);
          free = middle + half;
        }
        k = last + 1;
      }
    });
  }

  function at(host, event) {
    const box = event.target.getBoundingClientRect();
    const index = (from) => Math.max(0, Math.floor(from / host.size)), // the numbers at its edges are of the first cells
      [edge, left] = host.edge;
    return [index(event.clientY - box.top - edge), index(event.clientX - box.left - left)];
  }
  function told(host, event) {
    const data = host.operator,
      [i, j] = at(host, event),
      [r, c] = data.step,
      x = host.found.get(`${i} ${j}`) ?? 0;
    const span = (names, k, step) =>
      step === 1
        ? names[k]
        : `${names[k * step]} … ${names[Math.min((k + 1) * step, names.length) - 1]}`;
    if (data.row_names[i * r] === undefined || data.column_names[j * c] === undefined) return;
    const largest = r * c > 1 ? "largest " : "",
      place = [span(data.row_names, i, r), span(data.column_names, j, c)]
        .filter(Boolean)
        .join(", ");
    host.querySelector(".value").textContent = `${data.symbol}[${place}] = ${largest}${x}`;
  }
  function describe(host) {
    const data = host.operator;
    if (!data || data.problem) {
      host.querySelector(".value").textContent = "";
      return;
    }
    const blocks =
      data.step[0] * data.step[1] > 1
        ? `; a cell is ${data.step[0]} × ${data.step[1]} entries, click to see them`
        : "";
    host.querySelector(".value").textContent =
      `${data.shape[0]} × ${data.shape[1]}: ${data.words}${blocks}`;
    host.querySelector("canvas").title = "Rows and columns by the numbers of the bodies";
  }
  // The entries around a block that was clicked.
  function closer(host, event) {
    const { step, rows, columns, shape } = host.operator;
    if (step[0] * step[1] === 1) return;
    const around = (k, s, from, size) => {
      const low = Math.max(0, Math.min(from + k * s - 48, size - 96));
      return [low, Math.min(low + 96, size)];
    };
    const [i, j] = at(host, event);
    send("Inspect", {
      what,
      rows: around(i, step[0], rows[0], shape[0]),
      columns: around(j, step[1], columns[0], shape[1]),
    });
  }

  pgraph.view("operators", {
    build,
    operator: draw,
    selected: paint,
    theme: (host) => setTimeout(() => paint(host), 300),
  });
})();

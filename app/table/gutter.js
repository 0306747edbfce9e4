// The digraph as the gutter of the table: of each row its node and the lines that pass it, in a lane for
// each open branch. Loops are dashed arcs at its right.
pgraph.gutter = (() => {
  const ROW = 29,
    FIRST = 19,
    PITCH = 16,
    LOOP = 9,
    RADIUS = 7.7,
    BEND = 7; // [px]
  const WIDEST = 160; // [px] of the gutter: more lanes are moved along in it
  let last = 0,
    width = 0,
    full = 0,
    shift = 0,
    hues = new Map(),
    names = [],
    rows = [],
    shown = new Set();
  const lane = (k) => FIRST + PITCH * k,
    beside = (k) => last + RADIUS + 6 + LOOP * k,
    middle = ROW / 2;

  function set(data) {
    rows = data.rows;
    names = data.loops;
    hues = new Map(rows.map(({ number, color }) => [number, color]));
    last = lane(data.lanes - 1);
    full = Math.max(Math.ceil(data.beside ? beside(data.beside - 1) + 6 : last + RADIUS + 9), 52);
    width = Math.min(full, WIDEST);
    move(pgraph.host("table"), 0);
  }
  // All lanes moved along by as much, where they are wider than the gutter.
  function move(host, by) {
    shift = Math.min(Math.max(shift + by, 0), full - width);
    host.style.setProperty("--shift", `${-shift}px`);
    return full > width;
  }
  // The lane of a row in sight.
  function reveal(host, { lane: own }) {
    const x = lane(own) - shift;
    if (x < RADIUS || x > width - RADIUS) move(host, x - width / 2);
  }

  // Across from x to `to`, and round the corner; `way` is 1 down, -1 up.
  const across = (x, to, way) => {
    const near = Math.sign(to - x) * Math.min(BEND, Math.abs(to - x));
    return `M${x} ${middle}H${to - near}Q${to} ${middle} ${to} ${middle + way * BEND}V${way > 0 ? ROW : 0}`;
  };
  const SHAPES = {
    "|": (a) => `M${lane(a)} 0V${ROW}`,
    v: (a) => `M${lane(a)} ${middle}V${ROW}`,
    "^": (a) => `M${lane(a)} 0V${middle}`,
    d: (a, b) => across(lane(a), lane(b), 1),
    u: (a, b) => across(lane(a), lane(b), -1),
    I: (a) => `M${beside(a)} 0V${ROW}`,
    D: (a, b) => across(lane(a) + RADIUS, beside(b), 1),
    U: (a, b) => across(lane(a) + RADIUS, beside(b), -1),
  };
  // Numbers and our own shapes only: no text of a person is in it.
  function draw(box, { number, kind, lane: own, marks, color }) {
    const x = lane(own),
      edges = marks.filter(([shape]) => !"IDU".includes(shape)),
      loops = marks.filter(([shape]) => "IDU".includes(shape));
    const line = ([shape, a, b, of], name) =>
      `<path class="${name}" data-of="${of}" ${name === "edge" ? `style="--body:${hues.get(of)}"` : ""} d="${SHAPES[shape](a, b)}"/>`;
    box.innerHTML =
      `<svg class="gutter" width="${full}" height="${ROW}" aria-hidden="true">${edges.map((mark) => line(mark, "edge")).join("")}${loops.map((mark) => line(mark, "loop")).join("")}` +
      `<g class="node ${kind}" style="--body:${color}">${kind === "separation" ? `<circle class="outer" cx="${x}" cy="${middle}" r="${RADIUS + 2.3}"/>` : ""}<circle cx="${x}" cy="${middle}" r="${RADIUS}"/>` +
      `<text x="${x}" y="${middle + 3}">${number}</text></g></svg>`;
    for (const path of box.querySelectorAll(".loop"))
      path.append(pgraph.svg("title", {}, names[path.dataset.of]));
    light(box);
  }

  // The way from the selected body to the ground.
  function path(host, numbers) {
    shown = new Set(numbers);
    for (const box of host.querySelectorAll(".lanes")) light(box);
  }
  function light(box) {
    for (const edge of box.querySelectorAll(".edge"))
      edge.classList.toggle("path", shown.has(Number(edge.dataset.of)));
    const node = box.querySelector(".node"),
      row = box.closest("tr");
    node?.classList.toggle("path", shown.has(pgraph.table.row(row.dataset.name)?.number));
  }

  // The node of a body by number, as far as its row is drawn.
  function node(k) {
    const row = rows.find(({ number }) => number === k);
    return row && pgraph.table.tr(row.name)?.querySelector(".node");
  }

  const JOINTS = {
    revolute: "revolute",
    universal: "universal",
    weld: "weld",
    prismatic: "prismatic",
    free: "free",
    spherical: "spherical",
    cylindrical: "prismatic",
    beam: "beam",
  };
  const joint = (kind) => pgraph.icon(JOINTS[kind] ?? "compound", 14);
  return {
    set,
    draw,
    path,
    node,
    joint,
    move,
    reveal,
    get width() {
      return width;
    },
  };
})();

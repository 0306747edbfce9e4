// The engine in the browser: the kernels as WebAssembly, over a memory image that Python laid out.
// Every number is made by the same instructions as in Python; here they are only called in turn.
const pgraphEngine = (() => {
  const DONE = 0,
    RUNNING = 3; // status codes of a run that has not failed
  const WHY = {
    1: "the numbers are no longer finite: try a smaller step",
    2: "the constraints can no longer be met: the mechanism may be torn or at a singular position",
    4: "the error allows no step: something changes too fast",
    5: "it took too many steps",
    6: "the equations of a step could not be solved: try a smaller step",
  };
  const ROUNDS = 50n,
    NOTABLE = 1e-6; // as in pgraph_core/analysis/assembly.py
  const SAME = 1e-9,
    FRAMES = 1000,
    FIXED_RTOL = 1e-9; // as in pgraph_core/simulation/options.py
  const MOST_STEPS = 1e8;
  const ENTRIES = 8,
    SHAPE = 32; // in the struct of an array, as in image.py
  const SLICE = 30; // [ms] of computing between two looks at the page

  class Problem extends Error {}

  function pause() {
    // the page may draw and answer; timers would wait 4 ms
    return new Promise((go) => {
      const { port1, port2 } = new MessageChannel();
      port1.onmessage = () => {
        port1.close();
        go();
      };
      port2.postMessage(0);
    });
  }

  async function unpacked(text) {
    const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  // A run at its start; `advance` takes it on.
  class World {
    constructor(exports, names, header, image) {
      this.k = exports;
      this.header = header;
      this.image = image;
      const { base, size } = header;
      if (Number(exports.__heap_base.value) > base)
        throw new Problem("The figure is damaged: its memory overlaps.");
      const missing = base + size - exports.memory.buffer.byteLength;
      if (missing > 0) exports.memory.grow(Math.ceil(missing / 65536));
      this.bytes = new Uint8Array(exports.memory.buffer);
      this.data = new DataView(exports.memory.buffer);
      const table = Number(exports.table_of_kernels.value);
      this.number = Object.fromEntries(
        names.map((name, i) => [name, this.data.getUint32(table + 4 * i, true)]),
      );
      this.args = {};
      for (const [name, [at, ...shape]] of Object.entries(header.arrays))
        this.args[name] = flat(at, shape);
      this.q = this.floats("q");
      this.v = this.floats("v");
      // what a picture shows: the state, or where steps are chosen, one within the last of them
      this.shown = { t: 0, q: this.floats("q_shown"), v: this.floats("v_shown") };
    }

    floats(name) {
      const [at, ...shape] = this.header.arrays[name];
      return new Float64Array(
        this.data.buffer,
        at,
        shape.reduce((a, b) => a * b, 1),
      );
    }

    control(field) {
      return this.header.control + this.header.fields[field];
    }
    get t() {
      return this.data.getFloat64(this.control("time"), true);
    }

    show() {
      this.shown.t = this.t;
      this.shown.q.set(this.q);
      this.shown.v.set(this.v);
    }

    // Start again with `set` = [[field, value]]; the constraints are met, as `simulate` does first.
    reset(set = []) {
      const { header, data, k } = this;
      this.bytes.set(this.image, header.base);
      for (const [at, name] of header.links) data.setBigInt64(at, BigInt(this.number[name]), true);
      let packs = false;
      for (const [field, value] of set) {
        for (const [x, places, halves] of field.listed)
          if (x === value)
            places.forEach((at, i) => {
              data.setUint32(at, halves[2 * i], true);
              data.setUint32(at + 4, halves[2 * i + 1], true);
            });
        for (const [at, factor] of field.copies) data.setFloat64(at, factor * value, true);
        for (const [at, factor] of field.table) data.setFloat64(at, factor * value, true);
        packs ||= field.table.length > 0;
      }
      if (packs) this.pack();
      this.began = this.t;
      this.begin();
    }

    // The constants of the kernels from the table of bodies, by the kernel that packs them in Python.
    pack() {
      const { k, args, header } = this;
      const names = [
        "parent",
        "body",
        "motion",
        "start",
        "tracks",
        "rows",
        "const",
        "bodies_i",
        "bodies_f",
        "home",
      ];
      k.k_pack(...names.flatMap((name) => args[name]));
      for (const at of header.lengths) this.data.setFloat64(at, this.length(), true);
      for (const [from, to, size] of header.copies) this.bytes.copyWithin(to, from, from + size);
    }

    // Largest of the mechanism's own lengths [m], as `length_in` in pgraph_core/packing.
    length() {
      const [, rows] = this.header.arrays.rows; // behind them stand the tracks of curves
      const columns = this.header.arrays.const[2];
      const c = this.floats("const");
      const { mass, link, com, inertia } = this.header.columns;
      let gyration = 0,
        far = [0, 0];
      for (let r = 1; r < rows; r++) {
        const row = c.subarray(r * columns, (r + 1) * columns);
        if (row[mass] > 0)
          gyration = Math.max(
            gyration,
            (row[inertia] + row[inertia + 1] + row[inertia + 2]) / row[mass],
          );
        [link, com].forEach((at, i) => {
          far[i] = Math.max(
            far[i],
            Math.sqrt(row[at] * row[at] + row[at + 1] * row[at + 1] + row[at + 2] * row[at + 2]),
          );
        });
      }
      const found = Math.max(Math.sqrt(gyration), ...far);
      if (found > 0) return found;
      return (
        this.floats("home")
          .subarray(0, this.q.length)
          .reduce((most, x) => Math.max(most, Math.abs(x)), 0) || 1
      );
    }

    begin() {
      const { k, args, header, q, v } = this,
        scene = BigInt(header.scene),
        t = this.t;
      if (header.project) {
        const trial = this.floats("trial");
        trial.set(q);
        trial.set(v, q.length);
        const at = header.arrays.trial[0];
        const rounds = k.k_projection(
          scene,
          t,
          ...flat(at, [q.length]),
          ...flat(at + 8 * q.length, [v.length]),
          ROUNDS,
        );
        const moved = trial.reduce(
          (most, x, i) => Math.max(most, Math.abs(x - (i < q.length ? q[i] : v[i - q.length]))),
          0,
        );
        if (rounds < 0n || !(moved <= NOTABLE))
          throw new Problem("The constraints are not met at the start with these values.");
        q.set(trial.subarray(0, q.length));
        v.set(trial.subarray(q.length));
      }
      const accelerate = BigInt(this.number.acceleration);
      const code = k.k_constrained_dynamics(
        scene,
        accelerate,
        t,
        ...args.q,
        ...args.v,
        ...args.given,
        ...args.flow,
        ...args.vdot,
        ...args.wrenches,
      );
      if (code > 0n) throw new Problem("A joint has no inertia with these values.");
      if (code < 0n)
        throw new Problem("The acceleration at the start is not finite with these values.");
      if (header.bounded) k.k_bound_step(BigInt(header.run), BigInt(header.state));
      this.fresh = true;
      this.show();
    }

    // The next `n` steps of this width end at `end` [s].
    interval(n, width, end) {
      const { data, header } = this,
        at = (name) => header.arrays[name][0];
      if (header.widths) {
        data.setBigInt64(this.control("widths"), BigInt(header.widths.given), true);
        data.setFloat64(this.control("rtol"), FIXED_RTOL, true);
      }
      if (data.getFloat64(this.control("widest"), true) !== width || this.fresh) {
        data.setFloat64(this.control("widest"), width, true);
        data.setFloat64(this.control("origin"), this.t, true);
        data.setBigInt64(this.control("taken"), 0n, true);
        this.fresh = false;
      }
      data.setBigInt64(this.control("frame"), 1n, true);
      data.setBigInt64(this.control("last"), 2n, true);
      data.setBigInt64(this.control("left"), BigInt(n), true);
      data.setFloat64(at("times"), this.t, true);
      data.setFloat64(at("times") + 8, end, true);
    }

    // Take `n` of these steps. A step that ends at a bend of a force is taken in parts.
    advance(n) {
      const { header, data } = this,
        left = () => Number(data.getBigInt64(this.control("left"), true)),
        goal = left() - n;
      while (left() > goal) {
        if (header.logged) data.setBigInt64(header.logged, 0n, true);
        this.checked(this.k.k_advance_run(BigInt(header.run), BigInt(left() - goal)));
      }
    }

    // The steps that a method chooses, `step` at most, for a run of `span` [s]. Corners of tables from
    // `end` on are no part.
    choose(span, { step, rtol }, end) {
      const { header, data } = this,
        [, count] = header.arrays.corners;
      const before =
        BigInt(this.floats("corners").findIndex((t) => t >= end) + 1 || count + 1) - 1n;
      data.setBigInt64(header.corners + ENTRIES, before, true);
      data.setBigInt64(header.corners + SHAPE, before, true);
      data.setBigInt64(this.control("widths"), BigInt(header.widths.chosen), true);
      data.setFloat64(this.control("rtol"), rtol, true);
      data.setFloat64(this.control("widest"), step || span, true);
      data.setFloat64(this.control("span"), span, true);
      this.fresh = false;
    }

    // On by steps of the method's choice until one reaches `until`, the last ends at `end`; at most
    // `limit` [ms] of computing. Whether the state of that time is shown.
    reach(until, end, limit) {
      const { data, header, k } = this,
        times = header.arrays.times[0],
        run = BigInt(header.run);
      const due = performance.now() + limit,
        frame = this.control("frame");
      data.setFloat64(times, this.shown.t, true);
      data.setFloat64(times + 8, until, true);
      data.setFloat64(times + 16, end, true);
      data.setBigInt64(this.control("last"), until < end ? 3n : 2n, true);
      data.setBigInt64(frame, 1n, true);
      do this.checked(k.k_advance_run(run, 1n));
      while (data.getBigInt64(frame, true) === 1n && performance.now() < due);
      if (data.getBigInt64(frame, true) === 1n) return false;
      this.shown.t = until;
      return true;
    }

    checked(code) {
      if (Number(code) === RUNNING || Number(code) === DONE) return;
      throw new Problem(
        `The run stopped at t = ${this.t.toPrecision(6)} s: ${WHY[Number(code)] || "a step failed"}.`,
      );
    }

    // On by about `seconds` of motion, to be shown; what is left of them, as whole steps are taken,
    // and no more than SLICE is computed. `pulled`: what pulls moves then, so a step ends there.
    go(seconds, usual, span, pulled) {
      if (!this.header.widths) {
        const n = Math.floor(seconds / usual.step);
        if (n < 1) return seconds;
        this.interval(Number.MAX_SAFE_INTEGER, usual.step, Infinity);
        this.advance(n);
        this.show();
        return seconds - n * usual.step;
      }
      if (this.fresh) this.choose(span, usual, Infinity);
      const until = this.shown.t + seconds;
      return this.reach(until, pulled ? until : Infinity, SLICE) ? 0 : seconds;
    }

    // From the start to `end`, with the steps and the recorded times of `simulate`.
    async run(end, { step, rtol }) {
      this.fresh = true;
      let due = performance.now() + SLICE,
        rate = 64;
      if (rtol) {
        this.choose(end - this.began, { step, rtol }, end);
        for (const until of evenly(this.began, end)) {
          while (!this.reach(until, end, SLICE)) await pause();
          if (performance.now() > due) {
            await pause();
            due = performance.now() + SLICE;
          }
        }
        return;
      }
      for (const [n, width, until] of intervals(this.began, end, step)) {
        this.interval(n, width, until);
        for (let left = n; left > 0;) {
          const part = Math.min(left, rate),
            began = performance.now();
          this.advance(part);
          left -= part;
          const now = performance.now();
          if (now - began < SLICE / 4) rate *= 2;
          if (now > due) {
            await pause();
            due = performance.now() + SLICE;
          }
        }
      }
    }

    // Places (3 each) and rotations (9 each) of all bodies, world axes.
    poses() {
      const { k, args } = this;
      const names = [
        "rows",
        "const",
        "bodies_i",
        "bodies_f",
        "q_shown",
        "still",
        "view_work",
        "position",
        "rotation",
      ];
      k.k_poses(...names.flatMap((name) => args[name]));
      return [this.floats("position"), this.floats("rotation")];
    }

    // A spring from a point of a body, home axes of its row, to `target`, world axes; null: none.
    pull(grip) {
      const { header, data } = this,
        at = header.arrays.pull[0],
        own = header.own_loads;
      const count = BigInt(grip ? own + 1 : own);
      data.setBigInt64(header.loads + ENTRIES, count, true);
      data.setBigInt64(header.loads + SHAPE, count, true);
      data.setBigInt64(this.control("fresh"), 0n, true);
      if (!grip) return;
      const put = (name, value) => data.setFloat64(at + header.spring[name], value, true);
      data.setBigInt64(at + header.spring.row_a, BigInt(grip.row), true);
      data.setBigInt64(at + header.spring.row_b, 0n, true);
      for (let i = 0; i < 3; i++) {
        data.setFloat64(at + header.spring.point_a + 8 * i, grip.point[i], true);
        data.setFloat64(at + header.spring.point_b + 8 * i, grip.target[i], true);
      }
      put("stiffness", grip.stiffness);
      put("damping", grip.damping);
      put("rest", 0);
    }
  }

  // The arguments of an array of eight-byte numbers, as numba's calling convention has them.
  function flat(at, shape) {
    const count = shape.reduce((a, b) => a * b, 1),
      strides = [];
    let step = 8;
    for (let i = shape.length - 1; i >= 0; i--) {
      strides.unshift(BigInt(step));
      step *= shape[i];
    }
    return [0, 0, BigInt(count), 8n, at, ...shape.map(BigInt), ...strides];
  }

  // The recorded times of `simulate` after the first, where steps are chosen.
  function evenly(start, end) {
    const apart = (end - start) / FRAMES;
    return Array.from({ length: FRAMES }, (_, i) =>
      i + 1 < FRAMES ? (i + 1) * apart + start : end,
    );
  }

  // [[steps, width, end]] between the recorded times of `simulate`, as options.py has them.
  function intervals(start, end, step) {
    const span = end - start,
      steps = Math.max(Math.ceil(span / step - 1e-9), 1),
      least = Math.ceil(steps / FRAMES);
    let apart = least;
    for (let n = least; n < 4 * least; n++)
      if (steps % n === 0) {
        apart = n;
        break;
      }
    const given = Math.abs(steps * step - span) <= SAME * step ? step : span / steps,
      times = [];
    for (let k = 0; k < Math.ceil(steps / apart) + 1; k++) times.push(start + given * (k * apart));
    times[times.length - 1] = end;
    let whole = true,
      count = 0,
      most = 0;
    const found = [];
    for (let i = 0; i + 1 < times.length; i++) {
      const n = Math.max(Math.ceil((times[i + 1] - times[i]) / step - 1e-9), 1);
      count += n;
      most = Math.max(most, Math.abs(times[i + 1] - times[0] - step * count));
      found.push([n, (times[i + 1] - times[i]) / n, times[i + 1]]);
    }
    whole = most <= SAME * step + 4 * Number.EPSILON * Math.max(Math.abs(start), Math.abs(end));
    if (whole) for (const one of found) one[1] = step;
    return found;
  }

  // The figure's engine: `simulate` is what `window.pgraph_live` offers.
  class Engine {
    static async made(given) {
      if (typeof WebAssembly !== "object") throw new Problem("This browser has no WebAssembly.");
      const engine = new Engine();
      engine.given = given;
      engine.module = await WebAssembly.compile(await unpacked(given.wasm));
      engine.images = {};
      for (const [name, run] of Object.entries(given.runs))
        engine.images[name] = await unpacked(run.image);
      return engine;
    }

    async world(method = this.given.methods[0]) {
      const run = this.given.runs[method];
      if (!run)
        throw new Problem(
          `method: this figure has ${this.given.methods.join(", ")}; given ${String(method)}`,
        );
      const { exports } = await WebAssembly.instantiate(this.module, {});
      return new World(exports, this.given.kernels, run.header, this.images[method]);
    }

    // [[field of this method, value]] of {path: value}.
    fields(method, set) {
      return Object.entries(set || {}).map(([path, value]) => {
        const field = this.given.open.find((one) => one.path === path);
        if (!field) {
          const known = this.given.open.map((one) => one.path).join(", ") || "none";
          throw new Problem(`set: ${path} is not open in this figure; open: ${known}`);
        }
        if (typeof value !== "number" || !(value >= field.low && value <= field.high))
          throw new Problem(
            `${path}: must be a number from ${field.low} to ${field.high}${field.unit && ` ${field.unit}`}; given ${String(value)}`,
          );
        if (field.values.length && !field.values.includes(value))
          throw new Problem(`${path}: takes ${field.values.join(", ")}; given ${value}`);
        return [field.of[method], value];
      });
    }

    // The method for these steps where none is named, as `simulate` in Python chooses.
    method({ step, rtol }) {
      const { methods } = this.given,
        [usual] = methods,
        others = ["moreau_jean", "radau5"];
      if (others.includes(usual) || (step === undefined && rtol === undefined)) return usual;
      return rtol === undefined ? "rk4" : rtol > 1e-5 ? "dopri5" : "dop853";
    }

    async simulate(options = {}) {
      if (options === null || typeof options !== "object")
        throw new Problem(
          `simulate takes {t_end, step, rtol, method, set}; given ${String(options)}`,
        );
      const { t_end: until, step, rtol, method: named, set, ...rest } = options,
        { given } = this;
      const [unknown] = Object.keys(rest);
      if (unknown !== undefined)
        throw new Problem(`simulate takes t_end, step, rtol, method and set; given ${unknown}`);
      const method = named ?? this.method({ step, rtol }),
        t_end = until ?? given.t_end;
      const world = await this.world(method);
      for (const [name, value] of Object.entries({ step, rtol }))
        if (value !== undefined && (typeof value !== "number" || !(value > 0) || !isFinite(value)))
          throw new Problem(
            `${name}: must be a number > 0${name === "step" ? " [s]" : ""}; given ${String(value)}`,
          );
      if (rtol !== undefined && !world.header.widths)
        throw new Problem(`rtol: ${method} takes a step, not a tolerance; given ${rtol}`);
      if (rtol !== undefined && !(rtol >= 1e-15 && rtol <= 0.1))
        throw new Problem(`rtol: must lie within 1e-15 and 0.1; given ${rtol}`);
      if (typeof t_end !== "number" || !(t_end > given.t_start) || !isFinite(t_end))
        throw new Problem(`t_end: must be a number > ${given.t_start} [s]; given ${String(t_end)}`);
      const steps =
        step === undefined && rtol === undefined ? given.runs[method].usual : { step, rtol };
      const least = (t_end - given.t_start) / MOST_STEPS; // what is later than as many usual steps is not known here
      if (steps.step < least)
        throw new Problem(
          `step: ${steps.step} s makes more than ${MOST_STEPS} steps; give a larger one`,
        );
      if (given.step < least)
        throw new Problem(
          `t_end: must be less than ${MOST_STEPS * given.step} s after the start; given ${t_end}`,
        );
      world.reset(this.fields(method, set));
      await world.run(t_end, steps);
      return { t: world.t, q: world.q.slice(), v: world.v.slice() };
    }
  }

  return { Engine, World, Problem, unpacked };
})();

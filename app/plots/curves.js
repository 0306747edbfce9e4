// Numbers of curves: ranges and ticks of axes, spectra, and measurements of what is in sight.
pgraph.curves = (() => {
  const NOISE = 2 ** 12 * Number.EPSILON; // of the largest value of a plot: rounding of thousands of operations
  const BAND = 0.02; // of its way within which a curve has settled
  const LAST = 0.2; // of the time in sight: the part in which a settled curve rests; half a cosine varies by 0.1 of its way there
  const LOUD = 1e-3; // of the largest amplitude: smaller ones end a spectrum and count as no swing

  // The range of the curves of one unit.
  function scale(some, t0, t1) {
    let [y0, y1] = [Infinity, -Infinity];
    for (const { t, y } of some)
      for (let i = 0; i < t.length; i++) {
        if (t[i] >= t0 && t[i] <= t1) {
          y0 = Math.min(y0, y[i]);
          y1 = Math.max(y1, y[i]);
        }
      }
    if (!(y1 >= y0)) [y0, y1] = [0, 1];
    const least = 1e-9 * Math.max(Math.abs(y0), Math.abs(y1)) || 1e-12; // rounding is not blown up
    if (y1 - y0 < least) {
      y0 -= least;
      y1 += least;
    }
    const room = 0.06 * (y1 - y0);
    return {
      unit: some[0].unit,
      y0: y0 - room,
      y1: y1 + room,
      alone: some.length === 1 ? some[0] : null,
    };
  }

  // Round steps: 1, 2 or 5 times a power of ten.
  function ticks(low, high, most) {
    const raw = (high - low) / most,
      power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw);
    const found = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
    return { step, at: found };
  }
  function label(value, step) {
    if (Math.abs(value) < 1e-3 * step) return "0";
    const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const text =
      Math.abs(value) >= 1e5 || decimals > 4 ? value.toExponential(1) : value.toFixed(decimals);
    return text.replaceAll("-", "−");
  }

  // Amplitudes of a curve over the frequency: Hann's window on 2^n even samples, of which as few as it has points are made.
  function amplitudes(line, [t0, t1]) {
    const seen = line.t.filter((t) => t >= t0 && t <= t1).length;
    if (seen < 8) return { ...line, t: [], y: [] };
    const n = 2 ** Math.min(12, Math.ceil(Math.log2(seen))),
      [from, to] = [Math.max(t0, line.t[0]), Math.min(t1, line.t.at(-1))],
      span = to - from;
    let at = 0;
    const values = Array.from({ length: n }, (_, k) => {
      const time = from + (span * k) / n;
      while (at < line.t.length - 2 && line.t[at + 1] < time) at++;
      const share = (time - line.t[at]) / (line.t[at + 1] - line.t[at] || 1);
      return line.y[at] + Math.min(Math.max(share, 0), 1) * (line.y[at + 1] - line.y[at]);
    });
    const mean = values.reduce((sum, v) => sum + v, 0) / n;
    const re = values.map((v, k) => ((v - mean) * (1 - Math.cos((2 * Math.PI * k) / n))) / 2),
      im = new Array(n).fill(0);
    transform(re, im);
    const y = Array.from({ length: n / 2 }, (_, k) => (4 * Math.hypot(re[k], im[k])) / n),
      least = LOUD * Math.max(...y);
    const last = Math.max(8, y.findLastIndex((v) => v > least) + 2);
    return { ...line, t: y.slice(0, last).map((_, k) => k / span), y: y.slice(0, last) };
  }
  // The discrete Fourier transform in place, of a power of two (Cooley and Tukey 1965).
  function transform(re, im) {
    const n = re.length;
    for (let i = 1, j = 0; i < n; i++) {
      let bit = n >> 1;
      for (; j & bit; bit >>= 1) j ^= bit;
      j ^= bit;
      if (i < j) {
        [re[i], re[j]] = [re[j], re[i]];
        [im[i], im[j]] = [im[j], im[i]];
      }
    }
    for (let half = 1; half < n; half *= 2)
      for (let k = 0; k < n; k++) {
        if (k & half) continue;
        const a = (-Math.PI * (k % half)) / half,
          [c, s] = [Math.cos(a), Math.sin(a)],
          o = k + half;
        const [x, y] = [c * re[o] - s * im[o], s * re[o] + c * im[o]];
        [re[o], im[o], re[k], im[k]] = [re[k] - x, im[k] - y, re[k] + x, im[k] + y];
      }
  }

  // The part of a curve between two times, with its values at both.
  function within({ t, y }, t0, t1) {
    const found = [];
    t.forEach((at, i) => {
      const line = (time) => [
        time,
        y[i - 1] + ((time - t[i - 1]) / (at - t[i - 1])) * (y[i] - y[i - 1]),
      ];
      if (i && t[i - 1] < t0 && at > t0) found.push(line(t0));
      if (at >= t0 && at <= t1) found.push([at, y[i]]);
      if (i && t[i - 1] < t1 && at > t1) found.push(line(t1));
    });
    return found;
  }
  function overTime(seen) {
    let [low, high, area, square] = [Infinity, -Infinity, 0, 0];
    seen.forEach(([at, v], i) => {
      low = Math.min(low, v);
      high = Math.max(high, v);
      if (!i) return;
      const [before, u] = seen[i - 1],
        dt = at - before;
      area += (dt * (u + v)) / 2;
      square += (dt * (u * u + u * v + v * v)) / 3;
    });
    const span = seen.at(-1)[0] - seen[0][0];
    return { low, high, mean: area / span, rms: Math.sqrt(square / span) };
  }
  // Between the samples i - 1 and i: the time at which a curve has this value.
  const crossing = (seen, i, value) =>
    seen[i - 1][0] +
    ((value - seen[i - 1][1]) / (seen[i][1] - seen[i - 1][1])) * (seen[i][0] - seen[i - 1][0]);

  // Overshoot and settling time of a step. It has settled if its last part varies by less than BAND of its way from the start
  // to the mean of that part. Where it returns to its start, as after an impulse, the way is its largest swing, without overshoot.
  function stepped(seen, { low, high }) {
    const [start, value] = seen[0],
      end = seen.at(-1)[0];
    const last = overTime(
      within(
        { t: seen.map(([at]) => at), y: seen.map(([, v]) => v) },
        end - LAST * (end - start),
        end,
      ),
    );
    if (high === low) return null;
    const way = last.mean - value,
      returns = Math.abs(way) <= BAND * (high - low),
      size = returns ? high - low : Math.abs(way),
      spread = last.high - last.low;
    if (spread > BAND * size) return { settled: false };
    const band = BAND * size,
      out = seen.findLastIndex(([, v]) => Math.abs(v - last.mean) > band);
    const edge = last.mean + Math.sign(seen[out][1] - last.mean) * band;
    return {
      settled: true,
      final: last.mean,
      overshoot: returns ? null : Math.max(0, way > 0 ? high - last.mean : last.mean - low) / size,
      time: crossing(seen, out + 1, edge) - start,
    };
  }
  // Cycles a second, of at least two, or null. Each swing to the other side of a value is timed halfway between its two extremes:
  // of a decaying oscillation these times are evenly apart, whatever the value, as the crossings of one value are not.
  function frequency(seen, { low, high }, middle) {
    const extremes = [],
      least = LOUD * (high - low); // smaller swings count as none
    let side = 0;
    seen.forEach(([, v], i) => {
      const now = Math.abs(v - middle) > least ? Math.sign(v - middle) : side;
      if (now && now !== side) extremes.push(i);
      else if (now && now * (v - seen[extremes.at(-1)][1]) > 0) extremes[extremes.length - 1] = i;
      side = now;
    });
    const whole = extremes.filter((i) => i && i < seen.length - 1); // the others may go on out of sight
    const times = whole.slice(1).map((to, k) => {
      const from = whole[k],
        half = (seen[from][1] + seen[to][1]) / 2,
        sign = Math.sign(seen[to][1] - half);
      let i = from + 1;
      while (sign * (seen[i][1] - half) < 0) i++;
      return crossing(seen, i, half);
    });
    const cycles = Math.floor((times.length - 1) / 2);
    return cycles < 2 ? null : cycles / (times[2 * cycles] - times[0]);
  }
  // What the ruler says of a curve from t0 to t1, or null. Of what varies by rounding of `scale` it names no step and no frequency.
  function figures(line, [t0, t1], scale) {
    const seen = within(line, t0, t1);
    if (seen.length < 2) return null;
    const found = overTime(seen),
      varies = found.high - found.low > NOISE * scale;
    const step = varies ? stepped(seen, found) : null;
    return {
      ...found,
      step,
      frequency: varies ? frequency(seen, found, step?.final ?? found.mean) : null,
    };
  }
  // Four digits, and none below the error in one digit.
  function digits(value, error = 0) {
    const last = error > 0 ? 10 ** Math.floor(Math.log10(Number(error.toPrecision(1)))) : 0;
    return Number((last ? Math.round(value / last) * last : value).toPrecision(4))
      .toString()
      .replaceAll("-", "−");
  }
  const largest = (all) => Math.max(0, ...all.flatMap(({ y }) => y.map(Math.abs)));

  return { NOISE, amplitudes, digits, figures, label, largest, scale, ticks };
})();

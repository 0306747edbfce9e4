"""Dense output: the state of a run between its recorded frames, with an error estimate.

Quintic Hermite interpolation of q, q' and q'' between frames. v is the derivative of the
interpolant.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine.motions import facts
from ..errors import InputError, Problem, shown
from ..packing import Array, Ints, plain, quaternions
from ..portable import array_of
from ..tolerances import NAMED, NOTABLE, SOLVED

SMOOTH = 0.1  # ratio of the errors of quintic and cubic over two frames if motion is smooth
TURN = np.pi  # rad of an oscillation: wider frames show a slower one (Nyquist's limit)
TOO_WIDE = "frames are too coarse"  # beginning of the notice about such an oscillation
CUBIC_GAIN = 16  # the error over one frame is 1/64 of that over two if q is smooth; 4 is a reserve
KINK = 5  # the error at a jump of v, at any place between frames, is up to 4.5 (quintic - cubic)


def states_at(
    rows: Ints, frames: tuple[Array, Array, Array, Array], known: Array, asked: Any
) -> tuple[Array, Array, Any]:
    """Return (q, v, error) at the requested times `asked`, a scalar or an array, from frames (t, q,
    v, v').

    `rows` are the joint rows of the mechanism, `known` (n,) is the largest estimated error up to
    each frame. Raises InputError outside of the run.
    """
    t, q, v, vdot = frames
    times = _inside(asked, t)
    x = np.atleast_1d(times)
    i = np.clip(np.searchsorted(t, x, side="right") - 1, 0, max(len(t) - 2, 0))
    if len(t) == 1:
        found, speeds, missed = q[i].copy(), v[i].copy(), np.zeros(len(x))
    else:
        rate, bend = _derivatives(rows, q, v, vdot)
        curve = (t, q, rate, bend)
        found = _quintic(curve, i, i + 1, x)
        speeds = _velocities(rows, found, _quintic_rate(curve, i, i + 1, x), v.shape[1])
        for _, first, _ in quaternions(rows):
            part = found[:, first : first + 4]
            part /= np.linalg.norm(part, axis=1, keepdims=True)
        missed = _missed(curve, i, x)
        for k in (i, i + 1):  # recorded states are returned as they are
            same = x == t[k]
            found[same], speeds[same], missed[same] = q[k[same]], v[k[same]], 0.0
    error = known[np.minimum(np.searchsorted(t, x), len(t) - 1)] + missed
    if np.ndim(times) == 0:
        return found[0], speeds[0], float(error[0])
    return found, speeds, error


def unseen(rows: Ints, frames: tuple[Array, Array, Array, Array], length: float) -> list[int]:
    """Return the rows that oscillate too fast for the frames (t, q, v, v') to show their range.

    If a coordinate kept its rate, or its acceleration, for a third of the way to the next frame, it
    would move by more than half of what all frames together show; or v would, and not by what is
    left of a motion that died away: an oscillation has about two frames a period, or fewer.
    `length` is the mechanism's [m].
    """
    t, q, v, vdot = frames
    spans, slides = _spans(rows), facts("travels") & ~facts("angle")
    least, least_v = np.full(q.shape[1], NOTABLE), np.full(v.shape[1], NOTABLE)
    shown = np.ptp(q, axis=0)
    for kind, of_q, of_v in spans:
        if slides[kind]:
            least[of_q][:3] = least_v[of_v][-3:] = NOTABLE * (length or 1.0)
        least_v[of_v] += NOTABLE * shown[of_q].max()
    with np.errstate(over="ignore", invalid="ignore"):
        h = np.diff(t)[:, None] / TURN
        rate, bend = (np.abs(x[:-1]) for x in _derivatives(rows, q, v, vdot))
        sped = h * np.abs(vdot[:-1])
        far = np.maximum(h * rate, h * h * bend) > 0.5 * shown + least
        fast = (sped > 0.5 * np.ptp(v, axis=0)) & (h * sped > least_v)
    often = max(2.0, NAMED * len(h))
    missed, missed_v = far.sum(axis=0) >= often, fast.sum(axis=0) >= often
    return [k for k, (_, i, j) in enumerate(spans, 1) if missed[i].any() or missed_v[j].any()]


def _spans(rows: Ints) -> list[tuple[int, slice, slice]]:
    """Return (kind, slice in q, slice in v) for each row."""
    sizes, found = np.stack((facts("coordinates"), facts("freedoms")), axis=1).tolist(), []
    for _, kind, i, j, *_ in rows[1:].tolist():
        n, m = sizes[kind]
        found.append((kind, slice(i, i + n), slice(j, j + m)))
    return found


def _inside(asked: Any, t: Array) -> Array:
    """Return the times as floats. Raises InputError."""
    try:
        given = array_of(asked)
        times = np.asarray(np.nan if given.dtype.kind in "USb" else given, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim > 1 or not np.isfinite(times).all():
        text = f"must be a finite time or a list of them [s], got {shown(asked)}"
        raise InputError(Problem("run.at", "t", text))
    if not len(t):
        raise InputError(Problem("run.at", "t", "the run has no frame; see run.message"))
    slack = SOLVED * (t[-1] - t[0])
    outside = (times < t[0] - slack) | (times > t[-1] + slack)
    if outside.any():
        bad = float(np.atleast_1d(times)[np.atleast_1d(outside)][0])
        first, last = float(t[0]), float(t[-1])
        text = f"{bad!r} s is outside the run: give times from {first!r} to {last!r} s"
        raise InputError(Problem("run.at", "t", text))
    return np.clip(times, t[0], t[-1])


def _derivatives(rows: Ints, q: Array, v: Array, vdot: Array) -> tuple[Array, Array]:
    """Return (q', q'') from q, v, v'. Quaternions: q' = ½ ω q and q'' = ½ (ω' q + ω q')."""
    rate, bend = np.empty_like(q), np.empty_like(q)
    of_q, of_v = plain(rows)
    rate[:, of_q], bend[:, of_q] = v[:, of_v], vdot[:, of_v]
    for _, i, j in quaternions(rows):
        turn = slice(i, i + 4)
        rate[:, turn] = _half_product(v[:, j : j + 3], q[:, turn])
        bend[:, turn] = _half_product(vdot[:, j : j + 3], q[:, turn])
        bend[:, turn] += _half_product(v[:, j : j + 3], rate[:, turn])
    return rate, bend


def _velocities(rows: Ints, q: Array, rate: Array, nv: int) -> Array:
    """Compute v from q and q', using ω = 2 q' q⁻¹ for quaternions."""
    v = np.empty((len(q), nv))
    of_q, of_v = plain(rows)
    v[:, of_v] = rate[:, of_q]
    for _, i, j in quaternions(rows):
        w, u = q[:, i : i + 1], q[:, i + 1 : i + 4]
        turning = w * rate[:, i + 1 : i + 4] - rate[:, i : i + 1] * u
        turning += np.cross(u, rate[:, i + 1 : i + 4])
        v[:, j : j + 3] = 2 * turning / (w * w + np.sum(u * u, axis=1, keepdims=True))
    return v


def _half_product(omega: Array, q: Array) -> Array:
    """Return the quaternion products ½ ω q as an (n, 4) array."""
    w, u = q[:, :1], q[:, 1:]
    real = -np.sum(omega * u, axis=1, keepdims=True)
    return 0.5 * np.concatenate((real, w * omega + np.cross(omega, u)), axis=1)


def _cubic(t: Array, y: Array, rate: Array, i: Ints, k: Ints, x: Array) -> Array:
    """Evaluate the cubic Hermite polynomials between frames i and k at times x."""
    h = (t[k] - t[i])[:, None]
    s = (x - t[i])[:, None] / h
    rise = s * s * (3 - 2 * s)
    bent = h * s * (1 - s) * ((1 - s) * rate[i] - s * rate[k])
    return y[i] + rise * (y[k] - y[i]) + bent


def _quintic(frames: Any, i: Ints, k: Ints, x: Array) -> Array:
    """Evaluate the quintic Hermite polynomials between frames i and k at times x."""
    t, y, rate, bend = frames
    h = (t[k] - t[i])[:, None]
    s = (x - t[i])[:, None] / h
    left = 1 - s
    change = y[k] - y[i]
    found = y[i] + s**3 * (10 - 15 * s + 6 * s * s) * change
    found += h * s * left**3 * (1 + 3 * s) * rate[i]
    found -= h * left * s**3 * (1 + 3 * left) * rate[k]
    return found + 0.5 * h * h * s * s * left * left * (left * bend[i] + s * bend[k])


def _quintic_rate(frames: Any, i: Ints, k: Ints, x: Array) -> Array:
    """Evaluate the time derivatives of the quintic Hermite polynomials."""
    t, y, rate, bend = frames
    h = (t[k] - t[i])[:, None]
    s = (x - t[i])[:, None] / h
    left = 1 - s
    found = 30 * s * s * left * left * (y[k] - y[i]) / h
    found += left * left * (1 + 2 * s - 15 * s * s) * rate[i]
    found += s * s * (1 + 2 * left - 15 * left * left) * rate[k]
    return found + 0.5 * h * s * left * (
        left * (2 - 5 * s) * bend[i] - s * (2 - 5 * left) * bend[k]
    )


def _quintic_bend(frames: Any, i: Ints, k: Ints, x: Array) -> Array:
    """Evaluate the second time derivatives of the quintic Hermite polynomials."""
    t, y, rate, bend = frames
    h = (t[k] - t[i])[:, None]
    s = (x - t[i])[:, None] / h
    left = 1 - s
    found = 5 * (1 - 2 * s) * (y[k] - y[i]) / h - (3 - 5 * s) * rate[i] - (2 - 5 * s) * rate[k]
    found = 12 * s * left * found / h + left * (1 + s * (10 * s - 8)) * bend[i]
    return found + s * (1 + left * (10 * left - 8)) * bend[k]


def _missed(frames: Any, i: Ints, x: Array) -> Array:
    """Estimate the interpolation error in q at times x, in the intervals starting at frames i.

    In smooth motion, the error q⁽⁶⁾/720 (t - t_i)³ (t_k - t)³ of a quintic over two intervals is
    seen at the frame in between: it gives q⁽⁶⁾, and so the error over the interval itself. Both q
    and q'' are compared there, because a jump of v is missed by q at some place, and by q'' at none
    if frames are evenly spaced. If there is such a jump, the error is KINK times the difference
    between the quintic and the cubic. The estimate is inf if it exceeds the motion, if there are
    only two frames, or if the frames are so far apart that the polynomials may agree by chance.
    """
    t, q, rate, bend = frames
    rounding = 4 * np.finfo(float).eps * np.abs(q).max(initial=0.0)
    most = float(np.ptp(q, axis=0).max(initial=0.0)) + 1e3 * rounding
    rough, bent = _corrections(frames, i)
    width = t[i + 1] - t[i]
    steep, curved = (_at_both(np.abs(x).max(axis=1, initial=0.0), i) for x in (rate, bend))
    turned = np.maximum(width * steep / TURN, (width / TURN) ** 2 * curved)  # > most past Nyquist
    rough = np.where(turned > most, np.inf, rough)
    if len(t) < 3:
        smooth = rough <= SMOOTH * bent + rounding
        return np.where(smooth & (KINK * rough <= most), KINK * rough, np.inf)
    middle = np.arange(1, len(t) - 1)
    wide = np.abs(_quintic(frames, middle - 1, middle + 1, t[middle]) - q[middle])
    wide = wide.max(axis=1, initial=0.0)
    coarse = np.abs(_cubic(t, q, rate, middle - 1, middle + 1, t[middle]) - q[middle])
    coarse = coarse.max(axis=1, initial=0.0)
    apart = np.diff(t)
    area = apart[:-1] * apart[1:]
    # the second derivative of the error of smooth motion is at most the error / share
    share = area**2 / (6 * (area + np.diff(apart) ** 2))
    bent = np.abs(_quintic_bend(frames, middle - 1, middle + 1, t[middle]) - bend[middle])
    wide = np.maximum(wide, share * bent.max(axis=1, initial=0.0))
    near = np.stack([np.clip(i - 1, 0, len(wide) - 1), np.clip(i, 0, len(wide) - 1)])
    wider = apart[i] ** 2 / area[near]
    seen = np.maximum(wide[near] - rounding, 0.0)
    smooth = (seen * np.maximum(wider, 1.0) <= SMOOTH * coarse[near] + rounding).all(axis=0)
    grown = (seen * wider**3).max(axis=0) + (rounding * np.maximum(wider, 1.0) ** 3).min(axis=0)
    jump = np.maximum(KINK * rough, (seen * np.sqrt(np.maximum(wider, 1.0))).max(axis=0))
    smooth &= np.isfinite(rough)
    missed = np.where(smooth, grown / CUBIC_GAIN + rounding, np.maximum(jump, grown / CUBIC_GAIN))
    return np.where(missed <= most, missed, np.inf)


def _at_both(x: Array, i: Ints) -> Array:
    """Return the larger value at the two ends of each interval starting at frames i."""
    return np.maximum(x[i], x[i + 1])


def _corrections(frames: Any, i: Ints) -> tuple[Array, Array]:
    """Return the maxima of (quintic - cubic, cubic - linear) in the intervals from frames i."""
    t, q, rate, _ = frames
    rough, bent = np.zeros(len(i)), np.zeros(len(i))
    for share in (0.25, 0.5, 0.75):
        x = t[i] + share * (t[i + 1] - t[i])
        cubic = _cubic(t, q, rate, i, i + 1, x)
        line = q[i] + share * (q[i + 1] - q[i])
        quintic = _quintic(frames, i, i + 1, x)
        rough = np.maximum(rough, np.abs(quintic - cubic).max(axis=1, initial=0.0))
        bent = np.maximum(bent, np.abs(cubic - line).max(axis=1, initial=0.0))
    return rough, bent

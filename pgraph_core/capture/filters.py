"""Filters and derivatives of sampled motions.

The filter is that of OpenSim: Butterworth's, forward and backward, over the data continued by half
of its length, of which the ends are turned about their last points. Derivatives are those of the
natural spline of degree five through the samples (Woltring, Adv. Eng. Software 8 (1986) 104-113,
without smoothing).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import refusal, shown
from ..mechanism import Mechanism
from .markers import times
from .trial import Array

DEGREE = 5
LEAST = 8  # frames from which a motion of this degree is known


class Sampled(NamedTuple):
    """Values and two derivatives with respect to time, (n, ...) each."""

    x: Array
    v: Array
    a: Array


def filtered(t: Array, x: Array, cutoff: float, order: int) -> Sampled:
    """Filter samples (n, k) at times (n,), and differentiate them. Raises InputError.

    Samples at uneven times are first interpolated at even ones. No filter acts if the cut-off
    frequency is infinite.
    """
    if len(t) < LEAST:
        text = f"has {len(t)} frames, and derivatives need {LEAST}; give a longer trial"
        raise refusal("joint_moments", "fit", text)
    rate = (len(t) - 1) / float(t[-1] - t[0])
    if np.isinf(cutoff):
        return _derivatives(t, x, t)
    if not 0.0 < cutoff < rate / 2:
        text = f"must be > 0 and below {rate / 2:g} Hz, half the rate of frames, got {cutoff:g}"
        raise refusal("joint_moments", "cutoff", text)
    even = t[0] + np.arange(len(t)) / rate
    if np.abs(even - t).max() > 1 / (1000 * rate):
        x = _derivatives(t, x, even).x
    else:
        even = t
    pad = len(t) // 2
    long = np.concatenate((2 * x[:1] - x[pad:0:-1], x, 2 * x[-1:] - x[-2 : -pad - 2 : -1]))
    for _ in range(2):
        long = _forward(long, cutoff / (rate / 2), order)[::-1]
    beside = np.arange(-pad, len(x) + pad)
    at = np.interp(beside, np.arange(len(x)), even)
    at += np.where(beside < 0, beside, np.maximum(beside - len(x) + 1, 0)) / rate
    return _derivatives(at, long, t)


def _forward(x: Array, share: float, order: int) -> Array:
    """Filter samples by Butterworth's filter, which starts with the first samples as they are."""
    from scipy.signal import butter, lfilter, lfiltic

    b, a = butter(order, share)  # pyright: ignore
    state = np.array([lfiltic(b, a, one, one) for one in np.eye(order)[::-1]]).T @ x[:order]
    rest: Array = lfilter(b, a, x[order:], axis=0, zi=state)[0]  # pyright: ignore
    return np.concatenate((x[:order], rest))


def _derivatives(t: Array, x: Array, at: Array) -> Sampled:
    """Return the natural spline of degree five through samples, at other times."""
    from scipy.interpolate import make_interp_spline

    none = [(3, np.zeros(x.shape[1:])), (4, np.zeros(x.shape[1:]))]
    spline = make_interp_spline(t, x, DEGREE, bc_type=(none, none))
    return Sampled(*(spline(at, k) for k in range(3)))


def moved(mech: Mechanism, t: Array, q: Array, cutoff: float, order: int) -> Sampled:
    """Return q (n, nq), v and v' (n, nv) of a filtered motion. Raises InputError.

    Quaternions are filtered by their numbers and made unit again.
    """
    from ..dynamics.many import plan

    q = q.copy()
    for _, i, _ in mech.packed.quaternions:  # p and -p are the same attitude
        flips = np.sign((q[1:, i : i + 4] * q[:-1, i : i + 4]).sum(axis=1))
        q[1:, i : i + 4] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    x, rate, bend = filtered(t, q, cutoff, order)
    of_q, of_v = plan(mech.packed).plain
    v, a = np.zeros((2, len(t), mech.nv))
    v[:, of_v], a[:, of_v] = rate[:, of_q], bend[:, of_q]
    for _, i, j in mech.packed.quaternions:
        p, dp, ddp = (each[:, i : i + 4] for each in (x, rate, bend))
        size = (p * p).sum(axis=1, keepdims=True)
        back = p * np.array([1.0, -1, -1, -1]) * 2 / size
        spin = times(dp, back)[:, 1:]
        v[:, j : j + 3] = spin
        a[:, j : j + 3] = times(ddp, back)[:, 1:] - 2 * spin * (p * dp).sum(1, keepdims=True) / size
        x[:, i : i + 4] = p / np.sqrt(size)
    return Sampled(x, v, a)


def operators(t: Array, cutoff: float, order: int) -> Sampled:
    """Return the matrices (n, n) that take samples to filtered values and their derivatives."""
    return filtered(t, np.eye(len(t)), cutoff, order)


def checked(cutoff: float | None, order: int, smooth: bool) -> float:
    """Return the cut-off frequency [Hz]: 6 Hz by default, none of a smoothed motion."""
    if not (isinstance(order, int) and 1 <= order <= 10):
        text = f"must be a whole number from 1 to 10, got {shown(order)}"
        raise refusal("joint_moments", "order", text)
    if cutoff is None:
        return np.inf if smooth else 6
    if not (isinstance(cutoff, (int, float)) and cutoff > 0):
        text = f"must be a frequency [Hz] > 0, or float('inf') for no filter, got {shown(cutoff)}"
        raise refusal("joint_moments", "cutoff", text)
    return float(cutoff)

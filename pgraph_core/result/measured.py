"""Samples of imperfect outputs: their times, and their values with noise, delay and rounding.

Random numbers come from a counter: each is a function of the seed, the name of the output, the
component, the process and the index of its sample, by the mixing function of SplitMix64 [Steele,
Lea, Flood 2014]. Normal numbers use sums, products, quotients and square roots only, which every
processor rounds alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..dynamics.states import BodyMotion, Sensors, no_motion, turned
from ..errors import InputError, Problem, one_of, shown
from ..model.imperfect import Imperfect
from ..model.output import Output
from ..packing import Array
from ..tolerances import ROUNDING
from .records import ContactRecord, Named

if TYPE_CHECKING:
    from ..mechanism import Mechanism

GOLDEN = 0x9E3779B97F4A7C15  # odd, of the golden ratio: the step of the counter
MIXED = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1))  # shifts and factors
WORD = (1 << 64) - 1
TERMS = 18  # terms of the series of log and cos for the last digit
NOISE, BIAS, WALK = "noise", "bias", "walk"  # processes


class Measuring:
    """The methods of a `Result` about its outputs."""

    mechanism: Mechanism
    t: Array
    q: Array
    v: Array
    body_motion: cached_property[BodyMotion]
    contacts: ContactRecord

    def readings(self, outputs: Sequence[Output], /) -> dict[str, Array]:
        """Return the readings of outputs at the frames, {name: (n,), (n, 3) or (n, 4)}.

        The outputs need not be in the model.
        """
        mech = self.mechanism
        sensors = Sensors(mech.packed, mech.model.unchecked_copy({"outputs": tuple(outputs)}))
        motion = self.body_motion if sensors.moves else no_motion(len(self.t))
        read = sensors.read(self.q.copy(), self.v.copy(), motion, self.contacts.wrench)
        return sensors.by_name(read)

    @cached_property
    def outputs(self) -> Mapping[str, Array]:
        """Readings of the model's outputs, {name: (n,), (n, 3) or (n, 4)}. See `Output`."""
        return Named(self.readings(self.mechanism.model.outputs), "outputs", "output")

    @cached_property
    def measured(self) -> Mapping[str, Samples]:
        """Samples of the imperfect outputs by name, with `t`, `value` and `true`.

        See `Imperfect`. Runs without given frames have a frame at each time that is read.
        """
        wanted = (o for o in self.mechanism.model.outputs if o.imperfect is not None)
        found = {o.name: samples_of(self, o) for o in wanted}
        return Named(found, "measured", "output with imperfect=")

    def imu(self, at: str, /) -> Imu:
        """Return what an ideal inertial measurement unit reads that is fixed to a frame.

        Parameters
        ----------
        at : str
            Name of a body or site.

        Returns
        -------
        Imu
            The acceleration minus gravity and the angular velocity at the frames, in the axes of
            the body or site.

        Raises
        ------
        InputError
            If no body or site has this name.
        """
        known = [*self.mechanism.names, *(s.name for s in self.mechanism.model.sites)]
        if at not in known:
            text = f"no body or site is named {shown(at)}; {one_of(known)}"
            raise InputError(Problem("run.imu", "at", text))
        both = [Output(name=kind, kind=kind, at=at) for kind in ("accelerometer", "gyro")]
        return Imu(self.t, *self.readings(both).values())


class Imu(NamedTuple):
    """Readings of an inertial measurement unit at the frames of a run."""

    t: Array  # (n,) [s]
    acceleration: Array  # (n, 3) minus gravity, in its own axes [m/s^2]
    angular_velocity: Array  # (n, 3) in its own axes [rad/s]


class Samples(NamedTuple):
    """The samples of an output."""

    t: Array  # (n,) their times, multiples of the sample time [s]
    value: Array  # (n,) or (n, 3)
    true: Array  # the values that were read, without errors, limits and rounding


def sample_times(given: Imperfect, start: float, end: float) -> tuple[NDArray[np.int64], Array]:
    """Return the numbers k and the times k `sample` of the samples from `start` to `end` [s]."""
    near = ROUNDING * max(abs(start), abs(end))
    first, last = math.ceil((start - near) / given.sample), math.floor((end + near) / given.sample)
    k = np.arange(first, last + 1, dtype=np.int64)
    return k, k.astype(float) * given.sample


def reading_times(given: Imperfect, start: float, end: float) -> Array:
    """Return the times at which the values of samples are read, not before `start` [s]."""
    _, t = sample_times(given, start, end)
    return np.clip(t - given.latency, start, end)


def samples_of(run: Any, output: Output) -> Samples:
    """Return the samples of an imperfect output in a run.

    Values are read at frames, and between two frames on the line through them.
    """
    given = output.imperfect
    assert given is not None
    start, end = float(run.t[0]), float(run.t[-1])
    k, t = sample_times(given, start, end)
    read = np.clip(t - given.latency, start, end)
    if output.kind == "accelerometer":
        true = _felt(run, output, read, given.sample)
    else:
        true = _at(run.t, np.asarray(run.outputs[output.name]), read)
    columns = true.reshape(len(t), -1).T
    parts = output.reading.parts
    value = [_sampled(x, k, given, f"{output.name}\0{p}") for x, p in zip(columns, parts)]
    return Samples(t, np.array(value).T.reshape(true.shape), true)


def _at(t: Array, values: Array, asked: Array) -> Array:
    """Return values (n, ...) over t at other times, on lines between two of them."""
    i = np.clip(np.searchsorted(t, asked), 1, max(len(t) - 1, 1))
    before = t[i - 1]
    near = ROUNDING * np.abs(t).max(initial=0.0)
    if len(t) == 1:
        return values[np.zeros(len(asked), dtype=int)]
    share = np.clip((asked - before) / (t[i] - before), 0.0, 1.0)
    share[np.abs(asked - before) <= near] = 0.0
    share[np.abs(asked - t[i]) <= near] = 1.0
    share = share.reshape(-1, *(1,) * (values.ndim - 1))
    between = (1.0 - share) * values[i - 1] + share * values[i]
    return np.where(share == 0.0, values[i - 1], np.where(share == 1.0, values[i], between))


def _felt(run: Any, output: Output, read: Array, width: float) -> Array:
    """Return the mean specific force (n, 3) in the time `width` before each time [m/s^2].

    It is the change of velocity over the time, minus gravity, in the axes of the frame at the end.
    So it contains impacts. Where the run has no such time before, it is that of the first frame.
    """
    frame = [Output(name=kind, kind=kind, at=output.at) for kind in ("velocity", "rotation")]
    speed, turn = run.readings(frame).values()
    start, end = float(run.t[0]), float(run.t[-1])
    since = np.maximum(read - width, start)
    change = _at(run.t, speed, read) - _at(run.t, speed, since)
    known = read - since > ROUNDING * max(abs(start), abs(end))
    mean = change / np.where(known, read - since, 1.0)[:, None] - run.mechanism.model.gravity
    axes = np.stack([turned(turn, axis) for axis in np.eye(3)], axis=1)  # (n, axis, 3)
    found = np.einsum("nij,nj->ni", _at(run.t, axes, read), mean)
    return np.where(known[:, None], found, np.asarray(run.outputs[output.name])[0])


def _sampled(x: Array, k: NDArray[np.int64], given: Imperfect, name: str) -> Array:
    """Return the samples (n,) number k of the values x."""
    found = x + given.offset
    if given.random and len(k):
        found = found + errors(given, name, int(k[0]), int(k[-1]))
    low = -np.inf if given.low is None else given.low
    found = np.clip(found, low, np.inf if given.high is None else given.high)
    return given.quantum * np.rint(found / given.quantum) if given.quantum else found


def errors(given: Imperfect, name: str, first: int, last: int) -> Array:
    """Return the random errors of samples number `first` to `last` of a component.

    The bias and the walk begin at number 0, or at the first one if that is before it.
    """
    begin = min(first, 0)
    found = np.zeros(last + 1 - first)
    if given.density:
        white = normals(given.seed, f"{name}\0{NOISE}", first, last)
        found += given.density / math.sqrt(given.sample) * white
    if given.bias and given.correlation is not None:
        kept = math.exp(-given.sample / given.correlation)
        new = math.sqrt(-math.expm1(-2.0 * given.sample / given.correlation))
        draws = normals(given.seed, f"{name}\0{BIAS}", begin, last).tolist()
        later = (new * x for x in draws[1:])
        slow = accumulate(later, lambda b, x: kept * b + x, initial=draws[0])
        found += given.bias * np.array([*slow])[first - begin :]
    if given.walk:
        draws = normals(given.seed, f"{name}\0{WALK}", begin, last)
        draws[0] = 0.0
        found += given.walk * math.sqrt(given.sample) * np.cumsum(draws)[first - begin :]
    return found


# -- random numbers --------------------------------------------------------------------------------


def normals(seed: int, name: str, first: int, last: int) -> Array:
    """Return normal numbers of mean 0 and variance 1, number `first` to `last` of this name."""
    key = int.from_bytes(
        sha256(f"{seed}\0{name}".encode(errors="surrogatepass")).digest()[:8], "big"
    )
    k = np.arange(first, last + 1, dtype=np.int64).astype(np.uint64)
    u, turn = (_uniform(key, 2 * k + np.uint64(i)) for i in (0, 1))
    return np.sqrt(-2.0 * _log(u)) * _cos_of_turns(turn)


def _uniform(key: int, counter: NDArray[np.uint64]) -> Array:
    """Return numbers in (0, 1), of 52 bits, and one half of the last one."""
    x = counter * np.uint64(GOLDEN) + np.uint64(key)
    for shift, factor in MIXED:
        x = (x ^ (x >> np.uint64(shift))) * np.uint64(factor)
    return np.ldexp((x >> np.uint64(12)).astype(float) + 0.5, -52)


def _log(x: Array) -> Array:
    """Return the logarithm, from log m = 2 artanh((m - 1) / (m + 1)) for 1/2 <= m < 1."""
    m, power = np.frexp(x)
    s = (m - 1.0) / (m + 1.0)
    return power * math.log(2.0) + 2.0 * s * _horner([1 / (2 * k + 1) for k in range(TERMS)], s * s)


def _cos_of_turns(u: Array) -> Array:
    """Return the cosine of u turns, for 0 < u < 1, from the series of that of the half turn."""
    x = math.pi * (2.0 * u - 1.0)
    signs = [(-1) ** k / math.factorial(2 * k) for k in range(TERMS)]
    return -_horner(signs, x * x)


def _horner(coefficients: Sequence[float], x: Array) -> Array:
    found = np.zeros_like(x)
    for c in reversed(coefficients):
        found = found * x + c
    return found

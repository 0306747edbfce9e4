"""Measures for studies: differences between motions, and run times."""

from __future__ import annotations

import gc
import os
import platform
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median, quantiles
from typing import NamedTuple

import numpy as np

from ..dynamics.states import angles, bodies_over, turned
from ..engine.motions import facts
from ..mechanism import Mechanism
from ..packing import Array

TRUST = 10.0  # factor within which error estimates and resolved errors are trusted


class Errors(NamedTuple):
    """The dimensionless errors of one run. For example, 1e-6 means six digits."""

    rms: float  # over all times and observables
    largest: float  # over all times and observables

    @classmethod
    def of(cls, e: Array) -> Errors:
        """Create from an (n, m) array of errors, with a row for each time and a column for each
        observable."""
        if not np.isfinite(e).all():
            return cls(np.inf, np.inf)
        return cls(rms(e), float(np.max(e, initial=0.0)))


def rms(e: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(e * e)))


# -- of bodies: for error against run time, where engines have other coordinates -------------------


Measure = Callable[[Array], Array]  # (n, m) errors of a motion q (n, nq)


def measure_of(mech: Mechanism, known: Array) -> Measure:
    """Return the `differences` between a motion and its reference, both given as q (n, nq)."""
    observe, scale = observer(mech), reach(mech)
    places = observe(known)
    return lambda found: differences(observe(found), places, scale)


class Observables(NamedTuple):
    """The compared quantities at n states."""

    points: Array  # (n, a, 3) tips of the bodies [m]
    rotations: Array  # (n, b, 4) of the bodies, unit quaternions [w, x, y, z]


def observer(mech: Mechanism) -> Callable[[Array], Observables]:
    """Create a function of states q (n, nq) for the tip and rotation of every body."""
    tips = np.array([mech.model.body(name).tip_point for name in mech.names]).reshape(-1, 3)

    def observe(q: Array) -> Observables:
        n = len(q)
        still, none = np.zeros((n, mech.nv)), np.zeros((n, mech.nb, 6))
        pose = bodies_over(mech.packed.system, q, still, still, none).pose
        return Observables(pose[..., :3] + turned(pose[..., 3:], tips), pose[..., 3:])

    return observe


def differences(found: Observables, reference: Observables, scale: float) -> Array:
    """Return |y - y_ref| / max(|y_ref|, scale) (n, a + b), with rotations as angles [rad].

    Points are relative to the initial position of the reference, so the distance from the origin
    has no effect.
    """
    gap = np.linalg.norm(found.points - reference.points, axis=-1)
    moved = np.linalg.norm(reference.points - reference.points[:1], axis=-1)
    turned_by = angles(found.rotations, reference.rotations)
    return np.concatenate((gap / np.maximum(moved, scale), turned_by), axis=1)


def reach(mech: Mechanism) -> float:
    """Compute the characteristic length: the longest path along links to a tip [m]."""
    model, far = mech.model, {"ground": 0.0}
    longest = mech.packed.length
    for name in mech.names:
        body = model.body(name)
        link = 0.0 if body.parent == "ground" else float(np.linalg.norm(body.link))
        far[name] = far[body.parent] + link
        longest = max(longest, far[name] + float(np.linalg.norm(body.tip_point)))
    return longest or 1.0


# -- of joints: for the stability map, which names the joint that fails ----------------------------


def joint_errors(mech: Mechanism, q: Array, other: Array) -> Array:
    """Compute the difference between two motions (n, nq) per elementary motion, or inf if not
    finite.

    Rotations are in rad, translations relative to the mechanism's length.
    """
    rows = mech.packed.system.rows[1:].tolist()
    found = np.zeros((len(q), len(rows)))
    size = mech.packed.length
    for k, (_, kind, i, *_) in enumerate(rows):
        own = slice(i, i + int(facts("coordinates")[kind]))
        a, b = q[:, own], other[:, own]
        if facts("angle")[kind]:
            found[:, k] = np.abs(a[:, 0] - b[:, 0])
            continue
        if facts("attitude")[kind]:
            found[:, k] = angles(a[:, -4:], b[:, -4:])
            a, b = a[:, :-4], b[:, :-4]
        if a.shape[1]:
            found[:, k] = np.maximum(found[:, k], _distances(a, b, size))
    return np.where(np.isfinite(found), found, np.inf)


def _distances(x: Array, y: Array, size: float) -> Array:
    """Return distances (n,) relative to the mechanism's length or the largest |y| if larger."""
    scale = max(size, float(np.abs(y).max(initial=0.0)))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.linalg.norm(x - y, axis=1) / (scale or 1.0)


# -- run times ------------------------------------------------------------------------------------

Spread = tuple[float, float, float]  # lower quartile, median, upper quartile
SHORTEST_SAMPLE = 2e-3  # [s] a sample of a shorter run is the median of several runs
MOST_REPEATS = 20


def spread(values: Sequence[float]) -> Spread:
    """Return the lower quartile, median and upper quartile."""
    if len(values) < 2:
        return values[0], values[0], values[0]
    low, _, high = quantiles(values, n=4, method="inclusive")
    return low, median(values), high


def least(values: Sequence[float]) -> Spread:
    """Return the minimum, twice, and the upper quartile: other programs only add time."""
    return min(values), min(values), spread(values)[2]


@contextmanager
def undisturbed() -> Iterator[None]:
    """Disable garbage collection within the context."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def repeats(seconds: float) -> int:
    """Count the runs in a sample, given the duration of one run in seconds."""
    return max(1, min(MOST_REPEATS, int(SHORTEST_SAMPLE / max(seconds, 1e-9))))


def measured(
    runs: Sequence[Callable[[], float]],
    expected: Sequence[float],
    rounds: int,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda _: None,
    late: Callable[[], bool] = lambda: False,
) -> list[list[float]]:
    """Compute the times in seconds of every run in every round, as returned by each run.

    `expected` are rough seconds of the runs. `progress(fraction)` is called between the runs and
    may raise to end the measurement. If the time is over (`late`), no further run begins. In
    the first round, short runs come first.
    """
    shuffle = random.Random(seed)
    found: list[list[float]] = [[] for _ in runs]
    counts = [repeats(seconds) for seconds in expected]
    total = rounds * sum(n * s for n, s in zip(counts, expected)) or 1.0
    done = 0.0
    with undisturbed():
        for n in range(rounds):
            order = shuffle.sample(range(len(runs)), len(runs))
            for i in order if n else sorted(order, key=lambda i: expected[i]):
                if late():
                    return found
                found[i].append(median(runs[i]() for _ in range(counts[i])))
                done += counts[i] * expected[i]
                progress(min(1.0, done / total))
    return found


def machine(
    packages: tuple[str, ...] = ("pgraph-dynamics", "numpy", "numba"),
) -> dict[str, str | int]:
    """Return the CPU model, the available cores, and the versions of Python and of packages."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": cpu(),
        "cores": cores or 1,
        "python": platform.python_version(),
        **{name: package_version(name) for name in packages},
    }


def cpu() -> str:
    """Return the model name of the CPU."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def package_version(name: str) -> str:
    """Return a package's version, or a note that it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"

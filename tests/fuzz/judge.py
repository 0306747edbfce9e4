"""Judge of the fuzz test, which finds silently wrong runs.

Random scenes over scales of mass, length, time and stiffness run by default and by two other
settings, and are compared with known motions. A run is silently wrong if its error is more than ten
times its estimate, without a failed status or a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from pgraph_core.dynamics.states import differences
from pgraph_core.errors import PgraphError
from pgraph_core.mechanism import Mechanism
from pgraph_core.packing import Array
from pgraph_core.result import Result
from pgraph_core.result.dense import TOO_WIDE
from pgraph_core.simulation import simulate

from . import (
    bound_scenes,
    comparing_scenes,
    smooth_scenes,
    touching_scenes,
    yielding_scenes,
)
from .scene import KnownRun, Rng

FRAMES = 101
HONEST = 10.0  # largest error of a right run relative to its estimate
MOST = 300_000  # steps of a run: more take minutes
FINEST = {"method": "dop853", "rtol": 1e-13}


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    **smooth_scenes.FAMILIES,
    **bound_scenes.FAMILIES,
    **touching_scenes.FAMILIES,
    **comparing_scenes.FAMILIES,
    **yielding_scenes.FAMILIES,
}
SMOOTH = frozenset({*smooth_scenes.FAMILIES, *bound_scenes.FAMILIES})


def scenes(count: int, seed: int, first: int = 0) -> Iterator[KnownRun]:
    """`count` scenes from number `first` on, the families in turn.

    A scene depends on the seed and its number only.
    """
    families = list(FAMILIES.values())
    for k in range(first, first + count):
        yield families[k % len(families)](np.random.default_rng([seed, k]))


class Find(NamedTuple):
    """One judged run."""

    scene: KnownRun
    setting: dict[str, Any]
    verdict: str  # "right", "told", "silent", "refused", "unjudged"
    error: float  # true largest error of q over the motion's size
    estimate: float  # estimated error over the same size
    says: str  # the last notice, or the message
    number: int = -1  # number of the scene


def hunt(count: int, seed: int = 0, first: int = 0) -> Iterator[Find]:
    """Every run of `count` scenes from number `first` on, three of each."""
    for k, scene in enumerate(scenes(count, seed, first), first):
        for find in judged(scene, np.random.default_rng([seed, k, 1])):
            yield find._replace(number=k)


def judged(scene: KnownRun, rng: np.random.Generator) -> Iterator[Find]:
    """The runs of one scene: the default, and two of the other settings."""
    others = rng.choice(len(scene.others), size=min(2, len(scene.others)), replace=False)
    mech = Mechanism(scene.model)
    known = scene.known or finest(mech, scene)
    for setting in ({}, *(scene.others[i] for i in others)):
        yield _run(mech, scene, dict(setting), known)


def finest(mech: Mechanism, scene: KnownRun) -> Callable[[Array], Array]:
    """Return a far finer run as the motion, nan if there is none or its error is unknown."""

    def known(t: Array) -> Array:
        options: dict[str, Any] = {"t_eval": t, "max_steps": MOST, **FINEST, **scene.given}
        run = simulate(mech, t_end=scene.t_end, **options)
        known = run.status.ok and np.isfinite(run.error_estimate)
        return run.q if known else np.full((len(t), mech.nq), np.nan)

    return known


def _run(
    mech: Mechanism, scene: KnownRun, setting: dict[str, Any], known: Callable[[Array], Array]
) -> Find:
    given = dict(setting)
    if "parts" in given:
        given["step"] = scene.t_end / given.pop("parts")
    given = {"frames": FRAMES, "max_steps": MOST, **given, **scene.given}
    try:
        run = simulate(mech, t_end=scene.t_end, **given)
    except PgraphError as refused:
        return Find(scene, setting, "refused", np.nan, np.nan, str(refused))
    if not run.status.ok:
        return Find(scene, setting, "told", np.inf, np.nan, run.message)
    truth = known(run.t)
    error, size = off(mech, run, truth)
    estimate = run.error_estimate / size
    told = [text for text in run.notices if not text.startswith(TOO_WIDE)]  # not of the error
    says = told[-1] if told else run.message if np.isnan(estimate) else ""
    if np.isnan(error):
        return Find(scene, setting, "unjudged", error, estimate, says)
    if error <= HONEST * np.nan_to_num(estimate, nan=0.0, posinf=np.inf) + scene.floor:
        return Find(scene, setting, "right", error, estimate, says)
    return Find(scene, setting, "told" if says else "silent", error, estimate, says)


def off(mech: Mechanism, run: Result, truth: Array) -> tuple[float, float]:
    """(largest error of a run over the motion's size, that size [rad, m])."""
    turned, moved = (float(x.max()) for x in differences(mech.packed, run.q, truth))
    start = np.broadcast_to(truth[:1], truth.shape)
    around, slid = (float(x.max()) for x in differences(mech.packed, truth, start))
    size = max(around, 1.0) if turned >= moved else max(slid, mech.packed.length)
    return max(turned, moved) / (size or 1.0), size or 1.0


def line(find: Find) -> str:
    """One run in a line."""
    scene = find.scene
    return (
        f"{find.verdict.upper()} {find.number} {scene.family} ({scene.what}), "
        f"t_end={scene.t_end:.4g}, {find.setting or 'default'}: off by {find.error:.2g}, "
        f"says {find.estimate:.2g} {find.says}"
    )


def told(finds: Sequence[Find], seconds: float) -> str:
    """Return the runs that are wrong without a notice, a line each, and sums by family."""
    lines = [line(find) for find in finds if find.verdict == "silent"]
    verdicts = ("right", "told", "refused", "unjudged", "silent")
    for name in (*dict.fromkeys(find.scene.family for find in finds), "all"):
        of = [find for find in finds if name in (find.scene.family, "all")]
        count = ", ".join(f"{sum(f.verdict == v for f in of)} {v}" for v in verdicts)
        ratio = ratios(of)
        near = np.mean((ratio > 0.2) & (ratio < 10.0)) if len(ratio) else np.nan
        lines.append(f"{name}: {count}; within 0.2 to 10: {100 * near:.1f} % of {len(ratio)}")
    lines.append(f"{len(finds)} runs in {seconds:.0f} s")
    return "\n".join(lines)


def ratios(finds: Iterable[Find]) -> Array:
    """Return the estimates over the errors of all judged runs whose error is not rounding."""
    judged = (f for f in finds if f.verdict in ("right", "told", "silent"))
    known = (f for f in judged if f.scene.floor < f.error < np.inf and np.isfinite(f.estimate))
    return np.array([f.estimate / f.error for f in known])

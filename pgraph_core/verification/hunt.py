"""A hunt for runs that are wrong and do not say so.

Random scenes over scales of mass, length, time and stiffness, each run by default and by two other
settings, and compared with what is known of them. A run is *wrong and silent* if its error is more
than ten times what it says of itself, and neither its status nor a notice says anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.states import differences
from ..errors import PgraphError
from ..mechanism import Mechanism
from ..packing import Array
from ..result import Result
from ..result.dense import TOO_WIDE
from ..simulation import simulate
from . import bound_scenes, smooth_scenes, touching_scenes
from .scene import KnownRun, Rng

FRAMES = 101
HONEST = 10.0  # times the error estimate: an error within it was said
MOST = 300_000  # steps of a run: more take minutes
FINEST = {"method": "dop853", "rtol": 1e-13}


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    **smooth_scenes.FAMILIES,
    **bound_scenes.FAMILIES,
    **touching_scenes.FAMILIES,
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
    """One run of the hunt."""

    scene: KnownRun
    setting: dict[str, Any]
    verdict: str  # "right", "told", "silent", "refused", "unjudged"
    error: float  # true largest error of q over the motion's size
    estimate: float  # what the run says, over the same size
    says: str  # the last notice, or the message


def hunt(
    count: int, seed: int = 0, progress: Callable[[int], Any] | None = None, first: int = 0
) -> Iterator[Find]:
    """Every run of `count` scenes from number `first` on, three of each."""
    for k, scene in enumerate(scenes(count, seed, first), first):
        if progress is not None:
            progress(k)
        yield from judged(scene, np.random.default_rng([seed, k, 1]))


def judged(scene: KnownRun, rng: np.random.Generator) -> Iterator[Find]:
    """The runs of one scene: the default, and two of the other settings."""
    others = rng.choice(len(scene.others), size=min(2, len(scene.others)), replace=False)
    mech = Mechanism(scene.model)
    known = scene.known or finest(mech, scene)
    for setting in ({}, *(scene.others[i] for i in others)):
        yield _run(mech, scene, dict(setting), known)


def finest(mech: Mechanism, scene: KnownRun) -> Callable[[Array], Array]:
    """A far finer run as the motion; nan where there is none, or it does not know its own error."""

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
    rows = mech.packed.rows
    turned, moved = (float(x.max()) for x in differences(rows, run.q, truth))
    around, slid = (
        float(x.max()) for x in differences(rows, truth, np.broadcast_to(truth[:1], truth.shape))
    )
    size = max(around, 1.0) if turned >= moved else max(slid, mech.packed.length)
    return max(turned, moved) / (size or 1.0), size or 1.0


def told(finds: Sequence[Find], seconds: float) -> str:
    """What was wrong and silent, one line each, and the sums."""
    lines = []
    for find in finds:
        if find.verdict == "silent":
            lines.append(
                f"SILENT {find.scene.family} ({find.scene.what}), t_end={find.scene.t_end:.4g}, "
                f"{find.setting or 'default'}: off by {find.error:.2g}, says {find.estimate:.2g}"
            )
    count = {
        verdict: sum(find.verdict == verdict for find in finds)
        for verdict in ("right", "told", "refused", "unjudged", "silent")
    }
    lines.append(
        f"{len(finds)} runs in {seconds:.0f} s: "
        + ", ".join(f"{number} {verdict}" for verdict, number in count.items())
    )
    ratio = np.array(
        [
            find.estimate / find.error
            for find in finds
            if find.verdict in ("right", "silent")
            and find.error > find.scene.floor
            and np.isfinite(find.estimate)
        ]
    )
    if len(ratio):
        share = np.mean((ratio > 0.2) & (ratio < 10.0))
        lines.append(
            f"estimate over error: within 0.2 to 10 in {100 * share:.1f} % of {len(ratio)}"
        )
    return "\n".join(lines)

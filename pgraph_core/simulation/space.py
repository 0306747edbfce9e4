"""The error of dividing beams into segments, from a second run with other segments.

A run with n segments has an error of second order, so that the error follows from its difference to
a run with n/2 segments, divided by 3 (Richardson). It is the distance of the axes of beams, and of
the origins and tips of all bodies outside of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..dynamics.arguments import names_in
from ..errors import PgraphError, percent
from ..mechanism import Mechanism
from ..model import Model
from ..model.beam import AUTO, MOST_SEGMENTS
from ..model.segments import Counts, direction, refined, segment
from ..packing import Array
from ..result import Result
from ..result.records import Status
from ..tolerances import VISIBLE

Run = Callable[..., Result]


def divided(described: Model, counts: Counts) -> Mechanism:
    """Return the mechanism of a model whose beams have these cells in their spans."""
    return Mechanism(described.with_segments(counts))


def with_space_error(
    run: Result, simulate: Run, call: Mapping[str, Any], said: tuple[str, ...]
) -> Result:
    """Give a run the error of its segments, if a second run comes as far.

    `call` has the arguments of `simulate` but for the mechanism, and `said` are further notices.
    """
    if not run.status.ok:  # a run that failed has no segments to compare
        return run.with_space_error(None, said)
    mech = run.mechanism
    counts, factor = refined(mech.model.segments)
    other = divided(mech.model.described, counts)
    if run.status is Status.STOPPED and len(run.t) > 1:  # the second run has no such event
        call = {**call, "t_end": float(run.t[-1]), "t_eval": run.t, "frames": None}
    beside = repeated(mech, other, simulate, call)
    if isinstance(beside, str):
        return run.with_space_error(None, (*said, f"the error in space is not known: {beside}"))
    error = factor * apart(run, beside)
    told = () if beside.status.ok else (_ended(beside),)
    return run.with_space_error(error, (*said, *told, *_rough(error, mech)))


def _rough(error: Array, mech: Mechanism) -> tuple[str, ...]:
    """Return a notice if an error is so large that Richardson's rule may not hold."""
    length = max(beam.extent for beam in mech.model.described.beams)
    most = float(np.nanmax(error, initial=0.0))
    if most < VISIBLE * length:
        return ()
    counts = {name: 2 * sum(some) for name, some in mech.model.segments.items()}
    do = " and ".join(f"nodes={n} for '{name}'" for name, n in counts.items())
    text = f"the error in space of about {most:.2g} m is {percent(most / length)} of the length of "
    return (f"{text}the beam, and such an estimate is rough; give {do}",)


def _ended(beside: Result) -> str:
    return (
        f"the error in space is known until t = {beside.t[-1]:.4g} s, where the run with other "
        f"segments ended: {beside.message}"
    )


def repeated(
    mech: Mechanism, other: Mechanism, simulate: Run, call: Mapping[str, Any]
) -> Result | str:
    """Return the run of a call for a mechanism with other segments, or why there is none."""
    if call["tau"] is not None and names_in(call["tau"]) is None:
        return "torques that are no dictionary fit one number of segments; use forces of the model"
    start = {kind: carried(mech, other, kind, call[kind]) for kind in ("q", "v")}
    try:
        return simulate(other, **{**call, **start}, estimate=False)
    except PgraphError as error:
        return f"the run with other segments is refused: {error}"


def carried(mech: Mechanism, other: Mechanism, kind: str, given: Any) -> Any:
    """Return given coordinates or velocities for a mechanism whose beams have other segments.

    Joints of twice or half the cell take the sum or the half of what they replace. Values by name
    of body serve for both.
    """
    if given is None or names_in(given) is not None:
        return given
    x = np.asarray(given, float)
    found = other.home()[kind == "v"].copy()
    counts, own = mech.model.segments, other.model.segments
    for name, joint in other.joints.items():
        if name in mech.joints:
            found[getattr(joint, kind)] = x[getattr(mech.joints[name], kind)]
    for beam, cells in counts.items():
        n, m = sum(cells), sum(own[beam])
        rows = [x[getattr(mech.joints[segment(beam, k + 1)], kind)] for k in range(n)]
        bends = np.array([row[:: direction(k)] for k, row in enumerate(rows, 1)])
        bends = (
            bends.reshape(m, n // m, -1).sum(axis=1)
            if m <= n
            else np.repeat(bends * (n / m), m // n, axis=0)
        )
        for k, row in enumerate(bends, 1):
            found[getattr(other.joints[segment(beam, k)], kind)] = row[:: direction(k)]
    return found


def apart(run: Result, beside: Result) -> Array:
    """Return the largest distance so far (n,) of the same points in two runs [m].

    It is nan at times that the second run does not have, after its end.
    """
    n = min(len(run.t), len(beside.t))
    n = int(np.append(run.t[:n] != beside.t[:n], True).argmax())
    found, model, other = np.zeros(n), run.mechanism.model, beside.mechanism.model
    own = segments_of(run.mechanism) | segments_of(beside.mechanism)
    names = [name for name in run.mechanism.names if name not in own]
    places = [
        ((name, point), (name, point))
        for name in names for point in dict.fromkeys(((0.0,) * 3, model.body(name).tip_point))
    ]  # fmt: skip
    for beam, ends in model.axis_points.items():
        theirs = other.axis_points[beam]
        each = [max(1, len(x) // min(len(ends), len(theirs))) for x in (ends, theirs)]
        places += zip(ends[each[0] - 1 :: each[0]], theirs[each[1] - 1 :: each[1]], strict=True)
    for here, there in places:
        distance = run.position(*here)[:n] - beside.position(*there)[:n]
        np.maximum(found, np.linalg.norm(distance, axis=1), out=found)
    error = np.full(len(run.t), np.nan)
    error[:n] = np.maximum.accumulate(found)
    return error


def segments_of(mech: Mechanism) -> set[str]:
    """Return the names of all segments."""
    counts = mech.model.segments
    return {segment(beam, k) for beam, some in counts.items() for k in range(sum(some) + 1)}


# -- nodes="auto" ----------------------------------------------------------------------------------


def refines(mech: Mechanism) -> bool:
    """Check whether a beam of a mechanism asks for as many segments as its tolerance needs."""
    return any(beam.nodes == AUTO for beam in mech.model.described.beams)


def fine_enough(
    mech: Mechanism, simulate: Run, call: dict[str, Any]
) -> tuple[Mechanism, tuple[str, ...]]:
    """Return a mechanism with segments that meet the tolerance of its beams, and a notice about it.

    The state in `call` becomes that of this mechanism.

    The segments of beams with "auto" are doubled until Richardson's estimate is small enough.
    """
    described = mech.model.described
    autos = {beam.name: beam for beam in described.beams if beam.nodes == AUTO}
    most = min(beam.tolerance * beam.extent for beam in autos.values())
    coarse = repeated(mech, mech, simulate, call)
    if isinstance(coarse, str):
        return mech, (f"nodes='auto' of beams has no effect: {coarse}",)
    while True:
        counts = mech.model.segments
        finer = {x: [2 * n for n in some] if x in autos else some for x, some in counts.items()}
        other = divided(described, finer)
        run = repeated(mech, other, simulate, call)
        number = max(sum(finer[name]) for name in autos)
        said = ", ".join(f"'{name}' has {sum(finer[name])} segments" for name in autos)
        if isinstance(run, str):
            return mech, (f"beams: nodes='auto' ends: {run}",)
        call |= {kind: carried(mech, other, kind, call[kind]) for kind in ("q", "v")}
        error = apart(run, coarse)
        worst = float(np.nanmax(error, initial=0.0)) / 3
        ended = "" if run.status.ok and coarse.status.ok else run.message
        needed = number * (worst / most) ** 0.5  # the error falls with the square of the number
        if worst <= most or ended or max(2 * number, needed) > MOST_SEGMENTS:
            text = f"beams: {said}, by nodes='auto'"
            if worst > most:
                text += f", with an error in space of {worst:.2g} m above the tolerance of "
                text += (
                    f"{most:.2g} m, for which {MOST_SEGMENTS} are too few; give a larger tolerance"
                )
                text += ", a shorter run or more damping"
            return other, (text,)
        mech, coarse = other, run

"""The error of dividing beams into segments, from a second run with other segments.

A run with n segments has an error of second order, so that the error follows from its difference to
a run with n/2 segments, divided by 3 (Richardson). It is the distance of the axes of beams, and of
the origins and tips of all bodies outside of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..mechanism import Mechanism
from ..model import Model
from ..model.beam import AUTO, MOST_SEGMENTS
from ..model.segments import Counts, refined, segment
from ..packing import Array
from ..result import Result

Run = Callable[..., Result]


def divided(described: Model, counts: Counts) -> Mechanism:
    """Return the mechanism of a model whose beams have these cells in their spans."""
    return Mechanism(described.with_segments(counts))


def with_space_error(
    run: Result, simulate: Run, call: Mapping[str, Any], said: tuple[str, ...]
) -> Result:
    """Give a run the error of its segments, if a second run comes as far.

    `call` has the arguments of `simulate` but for the mechanism and its state, and `said` are
    further notices.
    """
    mech = run.mechanism
    counts, factor = refined(mech.model.segments)
    other = divided(mech.model.described, counts)
    beside = _repeated(run, other, simulate, call)
    if isinstance(beside, str):
        return run.with_space_error(None, (*said, f"the error in space is not known: {beside}"))
    error = factor * apart(run, beside)
    told = () if beside.status.ok or not run.status.ok else (_ended(beside),)
    return run.with_space_error(error, (*said, *told))


def _ended(beside: Result) -> str:
    return (
        f"the error in space is known until t = {beside.t[-1]:.4g} s, where the run with other "
        f"segments ended: {beside.message}"
    )


def _repeated(
    run: Result, other: Mechanism, simulate: Run, call: Mapping[str, Any]
) -> Result | str:
    """Return the same run of a mechanism with other segments, or why there is none."""
    tau = call["tau"]
    if callable(tau) or (tau is not None and np.size(tau) == run.mechanism.nv != other.nv):
        return (
            "torques of a function or an array fit one number of segments; use forces of the model"
        )
    q, v = (carried(run.mechanism, other, kind, getattr(run, kind)[0]) for kind in ("q", "v"))
    return simulate(other, q, v, **call, estimate=False)


def carried(mech: Mechanism, other: Mechanism, kind: str, x: Array) -> Array:
    """Return coordinates or velocities for a mechanism whose beams have other segments.

    Joints of twice or half the cell take the sum or the half of what they replace.
    """
    found = other.home()[kind == "v"].copy()
    counts, own = mech.model.segments, other.model.segments
    for name, joint in other.joints.items():
        if name in mech.joints:
            found[getattr(joint, kind)] = x[getattr(mech.joints[name], kind)]
    for beam, cells in counts.items():
        n, m = sum(cells), sum(own[beam])
        rows = [x[getattr(mech.joints[segment(beam, k + 1)], kind)] for k in range(n)]
        bends = np.array(rows)
        bends = (
            bends.reshape(m, n // m, -1).sum(axis=1)
            if m <= n
            else np.repeat(bends * (n / m), m // n, axis=0)
        )
        for k, row in enumerate(bends):
            found[getattr(other.joints[segment(beam, k + 1)], kind)] = row
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
    mech: Mechanism, q: Any, v: Any, simulate: Run, call: Mapping[str, Any]
) -> tuple[Mechanism, Array, Array, tuple[str, ...]]:
    """Return a mechanism with segments that meet the tolerance of its beams, its start, and what to
    say about it.

    The segments of beams with "auto" are doubled until Richardson's estimate is small enough.
    """
    described = mech.model.described
    autos = {beam.name: beam for beam in described.beams if beam.nodes == AUTO}
    most = min(beam.tolerance * beam.extent for beam in autos.values())
    coarse = simulate(mech, q, v, **call, estimate=False)
    while True:
        counts = mech.model.segments
        finer = {x: [2 * n for n in some] if x in autos else some for x, some in counts.items()}
        other = divided(described, finer)
        run = _repeated(coarse, other, simulate, call)
        number = max(sum(finer[name]) for name in autos)
        said = ", ".join(f"'{name}' has {sum(finer[name])} segments" for name in autos)
        if isinstance(run, str):
            return mech, coarse.q[0], coarse.v[0], (f"nodes='auto' of beams: {run}",)
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
            return other, run.q[0], run.v[0], (text,)
        mech, coarse = other, run

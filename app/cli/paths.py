"""The command `pgraph arms`: lengths and moment arms of paths over the range of a joint."""

from __future__ import annotations

import csv
import math
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.paths import Jump, jump_text, jumps_of
from pgraph_core.dynamics.ways import no_ways
from pgraph_core.errors import FileError, InputError, Problem, choices, shown
from pgraph_core.forces import BetweenPoints

from ..core.cells import UNITS, Display, Quantity, Refusal, quantity
from .terminal import MODEL, Answer, aligned, command, count, names, open_model, takes


@command(
    "arms",
    "lengths and moment arms of forces along paths over the range of a joint",
    *MODEL,
    takes("--over", metavar="JOINT", required=True, help="the body with the joint, or BODY.K for "
          "coordinate K of several, counted from 0"),
    takes("--range", type=names, metavar="A,B", help="first and last coordinate [rad, m], or with "
          "a unit, such as 0,130deg; default: the limits of the joint, or half a turn each way"),
    takes("--points", type=count, default=101, metavar="N", help="default: 101"),
    takes("-o", "--output", metavar="FILE", help="write a table (.csv)"),
)  # fmt: skip
def arms(args: Namespace) -> Answer:
    """Compute a table of lengths and moment arms. Raises PgraphError."""
    if args.output and Path(args.output).suffix.lower() != ".csv":
        raise FileError(Problem(args.output, "", "must end in .csv"))
    mech = pg.Mechanism(open_model(args))
    if not mech.path_names:
        text = "has no spring, strut or other force along a path; there are no moment arms"
        raise InputError(Problem(args.model, "", text))
    name, k = _coordinate(mech, args.over)
    at_q, at_v = mech.joints[name].q.start + k, mech.joints[name].v.start + k
    low, high = _limits(mech, name, k) if args.range is None else _ends(mech, name, k, args.range)
    q = np.repeat(mech.home()[0][None], args.points, axis=0)
    q[:, at_q] = np.linspace(low, high, args.points)
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # `_without_ways` counts the states
        found = [mech.path_length(q), mech.moment_arms(q)[:, :, at_v]]
    table = np.column_stack((q[:, at_q], *found))
    header = [args.over, *(f"{of}.{n}" for of in ("length", "arm") for n in mech.path_names)]
    data: dict[str, Any] = {name: column.tolist() for name, column in zip(header, table.T)}
    if args.output:
        with open(args.output, "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([header, *table.tolist()])
        data["output"] = args.output
        text = f"{args.output}: {len(table)} rows written"
    else:
        text = aligned(table.tolist(), header)
    jumps = _jumps(mech, q[0], (name, k), (min(low, high), max(low, high)))
    told = [jump_text(mech.packed, own) for own in jumps if own]
    told += _without_ways(mech, q, at_q)
    if told:
        data["notices"] = told
    return Answer(data, "\n".join((text, *told)))


def _jumps(
    mech: pg.Mechanism, q: np.ndarray, over: tuple[str, int], ends: tuple[float, float]
) -> list[list[Jump]]:
    """Return the jumps of each path over a range of a coordinate."""
    return [
        [
            jump
            for jump in jumps_of(mech.packed, f, q)
            if (jump.when.body, jump.when.coordinate) == over and ends[0] <= jump.at <= ends[1]
        ]
        for f in mech.model.forces
        if isinstance(f, BetweenPoints)
    ]


def _without_ways(mech: pg.Mechanism, q: np.ndarray, at_q: int) -> Iterator[str]:
    """Yield a sentence about each path that has no shortest way at some of the states."""
    for f in mech.model.forces:
        if not isinstance(f, BetweenPoints):
            continue
        bad = [x for x in q if any(no_ways(mech.packed, (f,), x, lambda _: ""))]
        if bad:
            when = f"at {len(bad)} of {len(q)} coordinates, first at {bad[0][at_q]:.6g}"
            yield from no_ways(mech.packed, (f,), bad[0], lambda _, when=when: when)


def _coordinate(mech: pg.Mechanism, given: str) -> tuple[str, int]:
    """Return the body and the number of a coordinate that one speed changes, given its joint or an
    output of its position. Raises InputError."""
    for output in mech.model.outputs:
        if output.kind == "joint_position" and output.name == given:
            return output.at, output.coordinate
    name, _, k = (given, "", "") if given in mech.joints else given.rpartition(".")
    single = {n: len(range(mech.nv)[j.v]) for n, j in mech.joints.items() if _plain(mech, n)}
    if name not in single:
        text = f"must be a joint of hinges or sliders ({choices(single)}), got {shown(given)}"
        raise InputError(Problem("pgraph arms", "--over", text))
    if not (k or single[name] == 1) or (k and not (k.isdigit() and int(k) < single[name])):
        text = f"'{name}' has the coordinates 0 to {single[name] - 1}; give one of them, such as "
        raise InputError(Problem("pgraph arms", "--over", f"{text}{name}.0, got {shown(given)}"))
    return name, int(k or 0)


def _plain(mech: pg.Mechanism, name: str) -> bool:
    """Check whether each coordinate of a joint has its own speed."""
    joint = mech.joints[name]
    return len(range(mech.nq)[joint.q]) == len(range(mech.nv)[joint.v]) > 0


def _ends(mech: pg.Mechanism, name: str, k: int, given: Sequence[str]) -> tuple[float, float]:
    """Return the typed range of a coordinate, where a unit at one end holds for both. Raises
    InputError."""
    of: Quantity = "length" if mech.model.body(name).sequence[k].facts.travels else "angle"
    example = "0,80mm" if of == "length" else "0,130deg"
    if len(given) != 2:
        text = f"must be the first and last coordinate, such as {example}, got {','.join(given)}"
        raise InputError(Problem("pgraph arms", "--range", text))
    units = [next((u for u in UNITS[of] if x.endswith(u)), "") for x in given]
    typed = [x if own else x + other for x, own, other in zip(given, units, units[::-1])]
    try:
        low, high = (quantity(x, of, Display()) for x in typed)
    except Refusal as refusal:
        text = f"{refusal}; give two of them, such as {example}"
        raise InputError(Problem("pgraph arms", "--range", text)) from None
    return low, high


def _limits(mech: pg.Mechanism, name: str, k: int) -> tuple[float, float]:
    """Return the range of a coordinate. Raises InputError if it has none."""
    body = mech.model.body(name)
    limits = body.limits[k] if k < len(body.limits) else None
    low, high = limits or (None, None)
    if low is not None and high is not None:
        return float(low), float(high)
    if body.sequence[k].facts.travels:
        text = f"'{name}' has no limits; give the first and last coordinate [m], such as 0,0.5"
        raise InputError(Problem("pgraph arms", "--range", text))
    return -math.pi, math.pi

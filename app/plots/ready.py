"""Ready plots: what is looked at first in a run, of the selected bodies or of all."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.forces import Activated
from pgraph_core.pulleys import without_segment

from . import KINDS, MANY, OF_JOINTS, POSES, SCENE, Signal, paths

MOST_CURVES = 8  # curves in a chart: as many as there are colours
MOST_CHARTS = 4  # charts of one quantity


class Ready(NamedTuple):
    """Charts that one press adds."""

    label: str
    signals: list[Signal]


def ready(run: pg.Result, selected: Sequence[str]) -> list[Ready]:
    """Return what can be plotted at once. Without a selection, these are all bodies and parts."""
    model = run.mechanism.model
    selected = [name for name in selected if name in run.mechanism.names]
    of = model.beam_of  # a beam stands for its segments
    names = selected or [name for name in run.mechanism.names if of.get(name, name) == name]
    moving = [name for name in names if model.body(name).dof]
    parts = (*model.constraints, *model.contacts, *model.forces)
    meant = {part.name for part in parts if not selected or {"*", *names} & {*part.touches}}
    strung = {part.name for part in parts if isinstance(part, pg.Cable | pg.Rope)}
    muscles = [f.name for f in model.forces if isinstance(f, Activated) and f.name in meant]
    turning = of_bodies(run, "angular_acceleration", names)
    found = (
        Ready("Positions", of_bodies(run, "q", moving)),
        Ready("Velocities", of_bodies(run, "v", moving)),
        Ready("Accelerations", turning or of_bodies(run, "acceleration", names)),
        Ready("Muscles", [
            *together("state", [f"activation.{name}" for name in muscles]),
            *together("tension", muscles),
        ]),
        Ready("Drives", of_parts(run, "drive_force", meant & run.drive_force.keys())),
        Ready("Forces", [
            *of_parts(run, "constraint_force", (meant - strung) & run.constraint_force.keys()),
            *of_cables(run, meant & strung),
            *of_parts(run, "contact_force", meant & run.contact_force.keys()),
        ]),
        Ready("Beams", [
            *(Signal("moment", name) for name in model.segments if name in names),
            *([Signal("space_error", SCENE)] if model.segments else []),
        ]),
        Ready("Energy", [Signal("energy", SCENE)]),
        Ready("Poses", [Signal(POSES, SCENE)]),
    )  # fmt: skip
    return [one for one in found if one.signals]


def of_bodies(run: pg.Result, kind: str, names: Sequence[str]) -> list[Signal]:
    """Return the quantity of one body, or its largest component for several, unless all are 0."""
    largest = sizes(run, kind, names)
    if not any(largest.values()):
        return []
    if len(names) == 1:
        return [Signal(kind, names[0])]
    component = "1" if kind in OF_JOINTS else max(largest, key=largest.__getitem__)
    return together(f"{kind}.{component}", names)


def of_parts(run: pg.Result, kind: str, names: Iterable[str]) -> list[Signal]:
    """Return the force of each part that carries a load, or one component if there are many."""
    loaded = [name for name in names if any(sizes(run, kind, [name]).values())]
    loaded.sort(key=list(getattr(run, kind)).index)
    largest = sizes(run, kind, loaded)
    if len(loaded) <= MOST_CHARTS and len(largest) > 1:
        return [Signal(kind, name) for name in loaded]
    component = max(largest, key=largest.__getitem__, default="")
    return together(f"{kind}.{component}" if component else kind, loaded)


def of_cables(run: pg.Result, names: Collection[str]) -> list[Signal]:
    """Return a chart of the tensions of each of these cables and ropes, if it has any."""
    known = {name: without_segment(name, names)[0] for name in run.tension}
    found = [
        Signal("tension", MANY.join(own))
        for own in paths(run)
        if known[own[0]] in names and any(np.any(run.tension[name]) for name in own)
    ]
    return found[:MOST_CHARTS]


def sizes(run: pg.Result, kind: str, names: Iterable[str]) -> dict[str, float]:
    """Return the largest absolute value of each component in the run."""
    found: dict[str, float] = {}
    for name in names:
        labels, columns = KINDS[kind].read(run, name)
        for label, size in zip(labels, np.nanmax(np.abs(columns), axis=0, initial=0.0).tolist()):
            found[label] = max(found.get(label, 0.0), size)
    return found


def together(kind: str, names: Sequence[str]) -> list[Signal]:
    """Return charts of about the same number of curves."""
    few = names[: MOST_CHARTS * MOST_CURVES]
    charts = max(1, -(-len(few) // MOST_CURVES))
    ends = [len(few) * k // charts for k in range(charts + 1)]
    return [Signal(kind, MANY.join(few[a:b])) for a, b in pairwise(ends) if a < b]

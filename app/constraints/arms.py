"""Pictures of the length and the moment arm of a path over each joint that moves it (pure)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.dynamics.paths import Jump, Paths, jumps_of
from pgraph_core.errors import counted
from pgraph_core.forces import BetweenPoints
from pgraph_core.packing.packed import Packed
from pgraph_core.tolerances import NOTABLE

from ..core.cells import Display, field, group
from ..core.state import of_model
from ..core.views import Payload
from ..pose.solving import ranges

Array = np.ndarray
DRAWN = 61  # points of a drawn curve
MOST = 6  # joints with pictures


def grouped(model: pg.Model, item: BetweenPoints, size: float, display: Display) -> list[Payload]:
    """Return the group of pictures of a path in a model of a size [m], or nothing if no joint
    moves it."""
    known = _known(model)
    if (item.name, display) not in known:
        known[item.name, display] = _group(model, item, size, display)
    return known[item.name, display]


@of_model
def _known(_: pg.Model) -> dict[tuple[str, Display], list[Payload]]:
    """Return the groups that were made of a model, to which others are added."""
    return {}


def _group(model: pg.Model, item: BetweenPoints, size: float, display: Display) -> list[Payload]:
    packed = pg.Mechanism(model).packed
    paths, q = Paths(packed, (item,)), packed.system.q
    all_of = (_over(packed, item, paths, q, of, size, display) for of in _moving(model, item))
    found = [*itertools.islice(filter(None, all_of), MOST)]
    if not found:
        return []
    note = field("arms", "", [], note="The other joints are as at the start.")
    state = f"over {counted(len(found), 'joint')}"
    return [group("Length and moment arm", [*found, note], False, state)]


def _moving(model: pg.Model, item: BetweenPoints) -> Iterator[tuple[str, int]]:
    """Yield (body, index) of each coordinate with a position that may change the length: of the
    joints between the bodies of a path, and of those with which its points ride."""
    above = [set[str]()]
    for name in dict.fromkeys((item.body, item.other, *(via.body for via in item.via))):
        own = set[str]()
        while name in model.row:
            own.add(name)
            name = model.body(name).parent
        above.append(own)
    riding = {(x.body, x.coordinate) for x in item._riding}
    between = set.union(*above) - set.intersection(*above[1:])
    for body in model.bodies:
        for k, place in enumerate(joints.places(body.sequence)):
            if place is not None and (body.name in between or (body.name, k) in riding):
                yield body.name, k


def _over(
    packed: Packed, item: BetweenPoints, paths: Paths, home: Array, of: tuple[str, int],
    size: float, display: Display,
) -> Payload | None:  # fmt: skip
    """Return a field with both curves over a coordinate, or None if the length is constant."""
    (name, k), body = of, packed.model.body(of[0])
    joint, place = packed.joints[name], joints.places(body.sequence)[k]
    assert place is not None, "it has a position"
    low, high = ranges(body, home[joint.q], size)[k]
    at = np.linspace(low, high, DRAWN)
    q = np.repeat(home[None], DRAWN, axis=0)
    q[:, joint.q.start + place] = at
    lengths, arms = (np.array(x) for x in zip(*map(paths.measured, q)))
    length, arm = lengths[:, 0], arms[:, 0, joint.v.start + k]
    if np.abs(arm).max() * (high - low) <= NOTABLE * length.max():
        return None
    slides = bool(packed.slides[joint.v.start + k])
    (unit, by), (metres, times) = display.of_unit("m" if slides else "rad"), display.of_unit("m")
    jumps = [x for x in jumps_of(packed, item, home.copy())
             if (x.when.body, x.when.coordinate) == of and low < x.at < high]  # fmt: skip
    dots = _dots(jumps, at, length, by, times)
    lines = [
        {"title": f"length [{metres}]", "dots": dots} | _line(by * at, times * length),
        {"title": "moment arm" if slides else f"moment arm [{metres}]"}
        | _line(by * at, (1.0 if slides else times) * arm),
    ]
    title = f"{name}.{k}" if body.dof > 1 else name
    return field("arms", f"Over {title}", [], curve={"lines": lines, "unit": unit})


def _line(x: Array, y: Array) -> Payload:
    return {"t": x.tolist(), "y": y.tolist()}


def _dots(jumps: list[Jump], at: Array, length: Array, by: float, times: float) -> Payload | None:
    """Return marks at the jumps of a length, on the drawn curve."""
    places = np.array([x.at for x in jumps])
    return _line(by * places, times * np.interp(places, at, length)) if jumps else None

"""The ground for a walk, and the footprints from a run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import Dynamics, model_of
from ..dynamics.arguments import wrong_type
from ..dynamics.states import turned
from ..engine.gait.tables import Terrain
from ..errors import explained, refusal, shown
from ..fields import fields_of
from ..model import Contact, Gait, Ground, Model, Step
from ..packing import Array
from ..result import Result
from ..result.records import SWING

# -- footprints ------------------------------------------------------------------------------------


@explained
class Footprint(NamedTuple):
    """One stance phase of a foot, with its position and time."""

    foot: str  # the contact
    start: float  # [s] time of its first recorded frame on the ground
    end: float  # [s] time of its last one
    x: float  # [m] its first position
    y: float
    z: float
    moved: float  # [m] the way of the sole while it was down
    push: float  # [N] mean normal force


@explained
def footprints(run: Result) -> tuple[Footprint, ...]:
    """Return the footprints of all contacts with a single point, sorted by time.

    Parameters
    ----------
    run : Result
        A run with contacts.

    Raises
    ------
    InputError
        If `run` is not a Result.
    """
    if not isinstance(run, Result):
        raise wrong_type("footprints", "run", "a pg.Result, which pg.simulate returns", run)
    model = run.mechanism.model
    points = {c.name: c for c in model.contacts if len(c.points) == 1 and c.name in run.phases}
    found = [
        print_
        for name, contact in points.items()
        for print_ in _prints(run, name, sole(run, contact.body, np.array(contact.points[0])))
    ]
    return tuple(sorted(found, key=lambda one: one.start))


def sole(run: Result, body: str, point: Array) -> Array:
    """Return the positions of a body point in world axes [m] as an (n, 3) array."""
    pose = run.body_pose[:, run.mechanism.topology.number(body) - 1]
    return pose[:, :3] + turned(pose[:, 3:], point)


def _prints(run: Result, name: str, at: Array) -> Iterable[Footprint]:
    down = run.phases[name] != SWING
    ends = np.flatnonzero(np.diff(np.concatenate(([0], down.astype(int), [0]))))
    for a, b in zip(ends[::2].tolist(), ends[1::2].tolist()):
        moved = float(np.linalg.norm(np.diff(at[a:b], axis=0), axis=1).sum())
        push = float(run.contact_normal[name][a:b].mean())
        x, y, z = at[a].tolist()
        yield Footprint(name, float(run.t[a]), float(run.t[b - 1]), x, y, z, moved, push)


# -- the ground ------------------------------------------------------------------------------------


def height_under(model: Model, x: float, z: float) -> float:
    """Return the ground height [m] at (x, z), from the plane and the last step at this position."""
    n = model.ground_normal
    height = -(n[0] * x + n[2] * z) / n[1]
    raised = 0.0
    for step in model.ground.steps:
        (x0, z0), (x1, z1) = step.low, step.high
        if x0 <= x <= x1 and z0 <= z <= z1:
            raised = step.height
    return height + raised / n[1]


def terrain_of(model: Model) -> Terrain:
    """Return the heights of the steps on a grid formed by all step edges.

    The arrays are empty without steps. If steps overlap, the last one is used.
    """
    steps, ny = model.ground.steps, model.ground_normal[1]
    if not steps:
        return Terrain(np.zeros(0), np.zeros(0), np.zeros((0, 0)))
    corners = np.array([(*step.low, *step.high) for step in steps])
    x, z = (np.unique(corners[:, k::2]) for k in (0, 1))
    x, z = (np.concatenate(([-np.inf], e, [np.inf])) for e in (x, z))
    heights = np.zeros((len(x) - 1, len(z) - 1))
    for (x0, z0, x1, z1), step in zip(corners, steps):
        inside = (x[:-1] >= x0) & (x[1:] <= x1), (z[:-1] >= z0) & (z[1:] <= z1)
        heights[np.ix_(*inside)] = step.height / ny
    return Terrain(x, z, heights)


LAWS: dict[str, dict[str, float]] = {  # contact of a paw's sole, which yields 2 mm under its load
    "complementarity": {},
    "penalty": {"stiffness": 5e4, "damping": 100.0},
    "soft": {"stiffness": 1e6, "damping": 0.5},
}


@explained
def underfoot(
    model: Model | Dynamics,
    *,
    law: str | None = None,
    friction: float | None = None,
    slope: float | None = None,
    steps: Sequence[Step] | None = None,
) -> Model:
    """Return a copy of a model on different ground.

    The arguments apply to all contacts with the ground.

    Parameters
    ----------
    model : Model or Mechanism
        The model with ground contacts.
    law : str, optional
        Contact law, including the stiffness and damping of the soles. With "penalty", explicit
        methods can use steps of up to 0.25 ms. For "soft", an implicit method such as "radau5"
        should be used.
    friction : float, optional
        Coefficient of friction.
    slope : float, optional
        Slope of the ground [rad].
    steps : sequence of Step, optional
        Rectangular areas of the ground at other heights.
    """
    model = model_of("underfoot", model)
    changes: dict[str, Any] = {} if friction is None else {"friction": friction}
    if changes:
        Contact(name="underfoot", body="any", **changes)  # even if no contact takes it
    if law is not None:
        changes |= {"law": law, "stiffness": None, "damping": None, **LAWS.get(law, {})}
    contacts = tuple(
        Contact(**{**fields_of(c), **changes}) if c.other == "ground" else c for c in model.contacts
    )
    ground = fields_of(model.ground)
    ground |= {} if slope is None else {"slope": slope}
    ground |= {} if steps is None else {"steps": tuple(steps)}
    return model.replace(contacts=contacts, ground=Ground(**ground))


# -- gaits -----------------------------------------------------------------------------------------


FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")


@explained
def gaits(feet: Sequence[str] = FEET) -> dict[str, Gait]:
    """Return the built-in gaits by name.

    Parameters
    ----------
    feet : sequence of str, optional
        Names of the contacts of the left front, right front, left hind and right hind foot.

    Raises
    ------
    InputError
        If there are not four names.
    """
    if isinstance(feet, str) or len(feet) != 4:
        raise refusal("gaits", "feet", f"must be the names of four contacts, got {shown(feet)}")
    known = json.loads(Path(__file__).with_name("gaits.json").read_text(encoding="utf-8"))
    for gait in known.values():
        gait["feet"] = [{"foot": foot, **fall} for foot, fall in zip(feet, gait["feet"])]
    return {name: Gait(name=name, **gait) for name, gait in known.items()}

"""Manual poses: joint coordinates as adjustable numbers, with loops kept closed (pure)."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

import pgraph_core as pg
from pgraph_core.analysis.inverse import nearest
from pgraph_core.joints import AXIAL, SIZE, Motion, slides
from pgraph_core.joints import places as places_of
from pgraph_core.model.poses import elementary
from pgraph_core.paper import bodies_of, frames, q_slices
from pgraph_core.show.shapes import to_wxyz

from ..run import Run
from . import Pose, State

HAND = "held by hand"  # the constraint that keeps a moved joint where it was put
HELD = 1e-6  # [rad, m] to which it is


@dataclass(frozen=True)
class Coordinate:
    """A joint's degree of freedom for a slider. Spatial rotations are given as rotation vectors."""

    body: str
    index: int  # among those of its joint
    label: str
    value: float
    low: float
    high: float
    unit: str  # rad or m
    turns: float = 0.0  # [rad] whole turns in `value`, where the joint looks the same after each


def shown_q(state: State) -> np.ndarray:
    """Return the displayed q (nq,): the manual pose, the nearest frame of the run, or home."""
    if (pose := state.pose) is not None:
        return pose.q
    if state.run is None:
        return home(state.whole)
    return np.asarray(state.run.result.q[_frame(state.run, state.playback.time)])


def shown_coordinate(state: State) -> Callable[[str, int], float]:
    """Return the function of (body, index) that gives a displayed coordinate [rad, m]."""
    places = dict[str, int]()

    def coordinate(name: str, k: int) -> float:
        if not places:
            first = 0
            for body in bodies_of(state.whole, pg.Topology.of(state.whole)):
                places[body.name], first = first, first + len(body.q)
        place = places_of(state.whole.body(name).sequence)[k]
        assert place is not None, "it is a hinge or slider"
        return float(shown_q(state)[places[name] + place])

    return coordinate


def shown_frame(state: State) -> int | None:
    """Return the index of the displayed frame of the run, or None where q is not of a run."""
    if state.pose is not None or state.run is None:
        return None
    return _frame(state.run, state.playback.time)


def shown_time(state: State) -> float | None:
    """Return the time of the displayed frame of the run [s], or None where q is not of a run."""
    frame = shown_frame(state)
    return None if frame is None or state.run is None else float(state.run.result.t[frame])


def shown_v(state: State) -> np.ndarray | None:
    """Return v (nv,) at the displayed frame of the run, or None to use the model's initial v."""
    frame = shown_frame(state)
    return None if frame is None or state.run is None else np.asarray(state.run.result.v[frame])


def _frame(run: Run, time: float) -> int:
    """Return the index of the frame nearest to a time."""
    return int(np.abs(np.asarray(run.result.t) - time).argmin())


def home(model: pg.Model) -> np.ndarray:
    """Return q (nq,) in the model's initial state, in number order."""
    bodies = bodies_of(model, pg.Topology.of(model))
    return np.array([x for body in bodies for x in body.q], dtype=float)


def coordinates(state: State, names: Container[str] | None = None) -> list[Coordinate]:
    """Return every joint coordinate at the displayed pose, for all bodies or those in `names`."""
    q, reach = shown_q(state), 2 * state.derived.size
    bodies = bodies_of(state.whole, pg.Topology.of(state.whole))
    found = []
    for body, place in zip(bodies, q_slices(bodies)):
        if body.name not in state.model.row or (names is not None and body.name not in names):
            continue
        for i, (label, value, low, high, near, unit) in enumerate(_of_joint(body, q[place], reach)):
            low, high = min(low, value), max(high, value)
            found.append(Coordinate(body.name, i, label, value, low, high, unit, near))
    return found


def degrees(body: pg.Body) -> list[tuple[str, str]]:
    """Return the label and unit of each degree of freedom of a joint: ("about z", "rad")."""
    return [(found[0], found[-1]) for found in _of_joint(body, np.asarray(body.q, float), 1.0)]


def ranges(body: pg.Body, q: np.ndarray, size: float) -> list[tuple[float, float]]:
    """Return the ends of the slider of each degree of freedom, of a model of that size [m]."""
    found = _of_joint(body, q, 2 * size)
    return [(min(low, value), max(high, value)) for _, value, low, high, *_ in found]


def _of_joint(
    body: pg.Body, q: np.ndarray, reach: float
) -> Iterator[tuple[str, float, float, float, float, str]]:
    limits = body.limits or (None,) * len(body.sequence)
    for number, ((motion, x), limit) in enumerate(zip(elementary(body, q), limits), start=1):
        low, high = limit or (None, None)
        if motion.kind in AXIAL:
            turns = not slides(motion)
            far = math.pi if turns else reach
            label = _label(motion, turns, number, len(body.sequence))
            label = "on track" if motion.track else label
            near = 2 * math.pi * round(float(x[0]) / (2 * math.pi)) if turns and not limit else 0.0
            low, high = (near - far if low is None else low), (near + far if high is None else high)
            whole = near if motion.facts.pivots else 0.0
            yield label, float(x[0]), low, high, whole, "rad" if turns else "m"
            continue
        for axis, value in zip("xyz", rotation_vector(np.asarray(x[-4:]))):
            yield f"about {axis}", float(value), -math.pi, math.pi, 0.0, "rad"
        for axis, value in zip("xyz", x[:-4]):
            far = float(value) - reach, float(value) + reach
            yield f"along {axis}", float(value), *far, 0.0, "m"


def _label(motion: Motion, turns: bool, number: int, count: int) -> str:
    """Return a short name of one of `count` motions about or along an axis: "about z", or "angle",
    "travel" or "axis 2" if it is oblique."""
    axis = np.asarray(motion.axis)
    for name, unit in zip("xyz", np.eye(3)):
        if np.allclose(axis / np.linalg.norm(axis), unit):
            return f"{'about' if turns else 'along'} {name}"
    return f"axis {number}" if count > 1 else "angle" if turns else "travel"


def moved(body: pg.Body, q: np.ndarray, index: int, value: float) -> np.ndarray:
    """Return q of a joint with coordinate `index` set to `value`."""
    q, i, place = q.copy(), index, 0
    for motion, x in elementary(body, q):
        size = SIZE[motion.kind][1]
        if i >= size:
            i, place = i - size, place + len(x)
            continue
        if size == 1:
            q[place] = value
        elif i >= 3:
            q[place + i - 3] = value
        else:
            vector = rotation_vector(np.asarray(x[-4:]))
            vector[i] = value
            q[place + len(x) - 4 : place + len(x)] = quaternion(vector)
        return q
    raise _cannot(body, f"its joint has no coordinate {index + 1}")  # asked before an edit


def rotation_vector(wxyz: np.ndarray) -> np.ndarray:
    """Convert a quaternion to a (3,) rotation vector, the axis times an angle in [0, pi]."""
    w, xyz = (wxyz[0], wxyz[1:]) if wxyz[0] >= 0 else (-wxyz[0], -wxyz[1:])
    sine = float(np.linalg.norm(xyz))
    return xyz * (2 * math.atan2(sine, w) / sine if sine > 0 else 2.0)


def quaternion(vector: np.ndarray) -> np.ndarray:
    """Convert a rotation vector to a (4,) quaternion [w, x, y, z]."""
    half = float(np.linalg.norm(vector)) / 2
    return np.array([math.cos(half), *(vector / 2 * np.sinc(half / math.pi))])


def posed(state: State, name: str, index: int, value: float) -> Pose:
    """Return the displayed pose with one coordinate moved and the loops closed.

    Raises PgraphError with the message to display if the loops cannot be closed.
    """
    model, top, q = state.whole, pg.Topology.of(state.whole), shown_q(state)
    number = top.number(name)
    place = q_slices(bodies_of(model, top))[number - 1]
    body = model.body(name)
    q = np.concatenate((q[: place.start], moved(body, q[place], index, value), q[place.stop :]))
    if any(c.active for c in model.constraints):
        q = closed(state, body, index, q)
    return pose_at(state, q)


def dragged(
    state: State, name: str, point: Sequence[float], target: Sequence[float]
) -> Pose:  # fmt: skip
    """Return the pose that brings a body's point (3,) as close as possible to a target (3,) [m].

    Free joints of other bodies do not move, so that an animal stays where it is. Raises
    PgraphError if the loops cannot be closed.
    """
    body = state.whole.body(name)
    if not state.kernels.ready:
        raise _cannot(body, "the kernels that close loops are still being compiled")
    mech = pg.Mechanism(state.whole)
    still = np.zeros(mech.nv, bool)
    for other, joint in mech.joints.items():
        still[joint.v] = joint.v.stop - joint.v.start == 6 and other != name
    q = nearest(mech, shown_q(state), name, point, target, still)
    if any(c.active for c in state.model.constraints):
        q, _, _ = mech.assemble(q, np.zeros(mech.nv))
    return pose_at(state, q)


def pose_at(state: State, q: np.ndarray) -> Pose:
    """Return the pose of the model's bodies at q."""
    positions, rotations = frames(state.whole, pg.Topology.of(state.whole), q)
    return Pose(state.model, state.run, state.playback.time, q, positions, to_wxyz(rotations))


def closed(state: State, body: pg.Body, index: int, q: np.ndarray) -> np.ndarray:
    """Find the closest q that satisfies the constraints, with one coordinate fixed."""
    if not state.kernels.ready:
        raise _cannot(body, "the kernels that close loops are still being compiled")
    model, held = state.whole, None
    if all(m.kind in AXIAL for m in body.sequence):
        goal = {"kind": "polynomial", "coefficients": [float(q[_first(model, body) + index])]}
        held = pg.Constraint(
            name=HAND,
            kind="motion",
            body=body.name,
            coordinate=index,
            q_of_t=goal,  # type: ignore[arg-type]
        )
        model = model.unchecked_copy({"constraints": (*model.constraints, held)})
    mech = pg.Mechanism(model)
    try:
        found, _, _ = mech.assemble(q, np.zeros(mech.nv))
    except pg.PgraphError:
        raise _cannot(body, "the loops cannot be closed there") from None
    place = _first(state.whole, body)
    stays = np.abs(found - q)[place : place + len(body.q)]
    if not held and float(stays.max(initial=0.0)) > HELD:
        raise _cannot(body, "the constraints hold it")
    return found


def _first(model: pg.Model, body: pg.Body) -> int:
    top = pg.Topology.of(model)
    return q_slices(bodies_of(model, top))[top.number(body.name) - 1].start


def _cannot(body: pg.Body, why: str) -> pg.PgraphError:
    return pg.InputError(pg.Problem(f"body '{body.name}'", "q", f"cannot be moved further: {why}"))


FREQUENCY = 1.5  # [Hz] at which what is pulled would swing to the mouse
WEIGHTS = 5.0  # the most it pulls, in weights of the whole model


def pull_force(
    point: np.ndarray, velocity: np.ndarray, target: np.ndarray, mass: float
) -> np.ndarray:
    """Return the (3,) pull force [N] towards `target` on a body at `point` moving with `velocity`.

    A critically damped spring with the natural frequency FREQUENCY for the `mass` [kg] of the
    model. The force is limited to WEIGHTS times the weight, so that a distant pointer does not
    cause excessive forces.
    """
    omega = 2 * math.pi * FREQUENCY
    force = mass * (omega**2 * (target - point) - 2 * omega * velocity)
    size, most = float(np.linalg.norm(force)), WEIGHTS * 9.81 * mass
    return force if size <= most else force * (most / size)

"""The quantities that cases compare with a reference, by name; each is one function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ..analysis import linear
from ..mechanism import Mechanism
from ..packing.system import Array
from ..result import Result
from ..rotation import matrix

Given: TypeAlias = "Mapping[str, Any]"


class States(NamedTuple):
    """States that are evaluated without a run."""

    mechanism: Mechanism
    q: Array  # (n, nq)
    v: Array  # (n, nv)


Motion: TypeAlias = "Result | States"


# -- of every frame: (n, k) ------------------------------------------------------------------------


def positions(motion: Motion, given: Given) -> Array:
    return _of_joints(motion.mechanism, motion.q, given, "q")


def speeds(motion: Motion, given: Given) -> Array:
    return _of_joints(motion.mechanism, motion.v, given, "v")


def accelerations(motion: Motion, given: Given) -> Array:
    mech = motion.mechanism
    if isinstance(motion, Result):
        return _of_joints(mech, motion.vdot, given, "v")
    found = np.array([mech.forward_dynamics(q, v) for q, v in zip(motion.q, motion.v)])
    return _of_joints(mech, found, given, "v")


def _of_joints(mech: Mechanism, states: Array, given: Given, which: str) -> Array:
    """Columns of the `bodies` (default: all), or some `columns` of them.

    `absolute`: summed from the ground outwards.
    """
    names = given.get("bodies", mech.names)
    if not given.get("absolute"):
        found = np.column_stack([states[:, getattr(mech.joints[name], which)] for name in names])
        return found[:, given["columns"]] if "columns" in given else found
    sums = np.zeros((len(states), mech.nb + 1))
    for number, (name, parent) in enumerate(zip(mech.names, mech.topology.parent.tolist()), 1):
        own = states[:, getattr(mech.joints[name], which)].sum(axis=1)
        sums[:, number] = sums[:, parent] + own
    return sums[:, [mech.topology.number(name) for name in names]]


def point(motion: Motion, given: Given) -> Array:
    """Position of `point` of `body` [m]; `axes`, such as "xy", picks coordinates."""
    place = np.array(given.get("point", (0.0, 0.0, 0.0)))
    poses = (motion.mechanism.pose(q, given["body"]) for q in motion.q)
    return np.array([x + R @ place for x, R in poses])[:, _axes(given)]


def point_velocity(motion: Motion, given: Given) -> Array:
    """[m/s], world axes."""
    mech, place = motion.mechanism, given.get("point", (0.0, 0.0, 0.0))
    jacobians = (mech.jacobian(q, given["body"], point=place) for q in motion.q)
    return np.array([J[3:] @ v for J, v in zip(jacobians, motion.v)])[:, _axes(given)]


def direction(motion: Motion, given: Given) -> Array:
    """Direction of `axis` of `body` in the world."""
    axis = np.array(given["axis"])
    return np.array([motion.mechanism.pose(q, given["body"])[1] @ axis for q in motion.q])


def rotation(motion: Motion, given: Given) -> Array:
    """(n, 9) rotation matrices of `body`, row by row."""
    return np.array([motion.mechanism.pose(q, given["body"])[1].ravel() for q in motion.q])


def spin(motion: Motion, given: Given) -> Array:
    """Angular velocity of `body` in its own axes [rad/s]."""
    mech, name = motion.mechanism, given["body"]
    return np.array(
        [
            mech.pose(q, name)[1].T @ mech.jacobian(q, name)[:3] @ v
            for q, v in zip(motion.q, motion.v)
        ]
    )


def energy(motion: Motion, given: Given) -> Array:
    """Kinetic and potential energy together [J]."""
    mech = motion.mechanism
    return np.array([[sum(mech.energy(q, v))] for q, v in zip(motion.q, motion.v)])


def constraint_force(motion: Motion, given: Given) -> Array:
    """[torque, force] of `constraint`, or the `rows` of it."""
    return _run(motion).constraint_force[given["constraint"]][:, _rows(given)]


def contact_force(motion: Motion, given: Given) -> Array:
    """[torque, force] of `contact` on its body, or the `rows` of it."""
    return _run(motion).contact_force[given["contact"]][:, _rows(given)]


def limit_torque(motion: Motion, given: Given) -> Array:
    """Torque or force of `limit` [N m or N]."""
    return np.reshape(_run(motion).contacts.limit[given["limit"]], (-1, 1))


def drift(motion: Motion, given: Given) -> Array:
    """Position error of the constraints [m]."""
    return _run(motion).constraint_drift[:, :1]


# -- of a whole run, or of a mechanism -------------------------------------------------------------


def event_times(motion: Motion, given: Given) -> Array:
    """When contacts and limits change [s]."""
    return np.reshape([event.t for event in _run(motion).events], (-1, 1))


def last_event(motion: Motion, given: Given) -> Array:
    """When the last of them changes [s]."""
    return event_times(motion, given)[-1:]


def frequencies(motion: Motion, given: Given) -> Array:
    """Of small motions about the first state, at rest [rad/s]; the `modes` in ascending order."""
    found = linear.frequencies(motion.mechanism, motion.q[0])
    return np.reshape(found[given["modes"]], (-1, 1))


def response(motion: Motion, given: Given) -> Array:
    """Acceleration of `point` of `body` along `direction` for each N along `force` [1/kg]."""
    mech, place = motion.mechanism, given["point"]
    number = mech.topology.number(given["body"]) - 1
    found = []
    for q in motion.q:
        J = mech.jacobian(q, given["body"], point=place)
        x, R = mech.pose(q, given["body"])
        push = np.zeros((mech.nb, 6))
        push[number, 3:] = given["force"]
        push[number, :3] = np.cross(R @ np.array(place), given["force"])
        still = np.zeros(mech.nv)
        by = mech.forward_dynamics(q, still, external=push) - mech.forward_dynamics(q, still)
        found.append([np.array(given["direction"]) @ (J[3:] @ by)])
    return np.array(found)


KINDS: Mapping[str, Callable[[Motion, Given], Array]] = {
    "q": positions,
    "v": speeds,
    "vdot": accelerations,
    "point": point,
    "point_velocity": point_velocity,
    "direction": direction,
    "rotation": rotation,
    "spin": spin,
    "energy": energy,
    "constraint_force": constraint_force,
    "contact_force": contact_force,
    "limit_torque": limit_torque,
    "drift": drift,
    "event_times": event_times,
    "last_event": last_event,
    "frequencies": frequencies,
    "response": response,
}
VECTORS = ("point", "point_velocity", "direction", "spin", "constraint_force", "contact_force")


def errors(kind: str, found: Array, reference: Array, scale: float) -> Array:
    """(n,) |found - reference| / max(|reference|, scale) of each row, the worst of its numbers.

    Points, directions and forces count as vectors, rotations by the angle between both [rad].
    """
    apart = found - reference
    if kind == "rotation":
        return 2.0 * np.arcsin(np.minimum(np.linalg.norm(apart, axis=1) / np.sqrt(8.0), 1.0))
    if kind in VECTORS:
        size = np.linalg.norm(reference, axis=1)
        return np.linalg.norm(apart, axis=1) / np.maximum(size, scale)
    return np.max(np.abs(apart) / np.maximum(np.abs(reference), scale), axis=1)


def rotations(reference: Array) -> Array:
    """(n, 9) of matrices, or of quaternions (n, 4)."""
    if reference.shape[1] == 9:
        return reference
    return np.array([np.ravel(matrix(q)) for q in reference])


def _run(motion: Motion) -> Result:
    assert isinstance(motion, Result)  # a case of states alone has no such kind
    return motion


def _axes(given: Given) -> list[int]:
    return ["xyz".index(axis) for axis in given.get("axes", "xyz")]


def _rows(given: Given) -> list[int]:
    return list(given.get("rows", range(6)))

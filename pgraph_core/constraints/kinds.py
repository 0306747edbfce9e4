"""The kinds of constraints, each a small table of blocks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..engine import layout as at
from ..model import Polynomial, Sine, Table
from ..rotation import normals_of, unit_vector
from ..system import joint_coordinates
from .ends import Block, Ends

APART = 1e-6  # rad: axes of a prismatic constraint that differ by more contradict each other


def blocks_of(ends: Ends) -> list[Block]:
    """The blocks of the constraint's kind. Raises ModelError."""
    return _KINDS[ends.c.kind](ends)


def _revolute(e: Ends) -> list[Block]:
    axis, other = e.directions()
    return [e.held(), e.aligned(axis, normals_of(other))]


def _prismatic(e: Ends) -> list[Block]:
    axis, other = e.directions()
    apart = float(np.arccos(np.clip(abs(other @ e.turn @ axis), 0.0, 1.0)))
    if apart > APART:
        text = (
            "a prismatic constraint keeps the orientation of the initial state, in which axis and "
            f"other_axis are {apart:.3g} rad apart; leave one of them out"
        )
        raise e.refuse("other_axis", text)
    return [e.turned_as_at_home(), e.held(normals_of(other))]


def _cylindrical(e: Ends) -> list[Block]:
    axis, other = e.directions()
    normals = normals_of(other)
    return [e.aligned(axis, normals), e.held(normals)]


def _universal(e: Ends) -> list[Block]:
    if e.c.axis is None:  # as the joint of this name: about x of `other`, then about y of `body`
        axis, other = np.eye(3)[1], e.turn @ np.eye(3)[0]
    else:
        axis, other = e.directions()
    return [e.held(), e.aligned(axis, [other])]


def _distance(e: Ends) -> list[Block]:
    apart = e.position_a + e.rotation_a @ e.point - (e.position_b + e.rotation_b @ e.other_point)
    length = float(np.linalg.norm(apart)) if e.c.length is None else e.c.length
    if length <= 1e-12 * e.size:
        text = "the two points coincide in the initial state; give a length > 0 [m]"
        raise e.refuse("length", f"{text}, or use kind 'point'")
    return [Block(at.T_DISTANCE, 1, e.values(length))]


def _line(e: Ends) -> list[Block]:
    return [e.held(normals_of(e.directions()[1]))]


def _plane(e: Ends) -> list[Block]:
    return [e.held([e.directions()[1]])]


def _rolling(e: Ends) -> list[Block]:
    if e.c.other_axis is not None:
        normal = unit_vector(e.c.other_axis)
    else:
        normal = np.array(e.model.ground_normal if e.b == 0 else (0.0, 0.0, 1.0))
    shape = e.model.body(e.c.body).shape
    radius = e.c.radius if e.c.radius is not None else shape.radius if shape else None
    dirs = [normal, *normals_of(normal)]
    if e.c.axis is None:
        return [Block(at.T_SPHERE, 3, e.values(radius or 0.0, dirs))]
    return [Block(at.T_DISC, 3, e.values(radius or 0.0, dirs, [unit_vector(e.c.axis)]))]


def _skate(e: Ends) -> list[Block]:
    return [Block(at.T_BLADE, 1, e.values(aims=[e.directions()[0]]))]


def _gear(e: Ends) -> list[Block]:
    own = e.coordinate(e.c.body, e.c.coordinate, 1.0)
    other = e.coordinate(e.c.other, e.c.other_coordinate, -(e.c.ratio or 1.0))
    return [Block(at.T_COORD, 1, e.values(e.c.offset or 0.0), (own, other))]


def _motion(e: Ends) -> list[Block]:
    own, q_of_t = e.coordinate(e.c.body, e.c.coordinate, 1.0), e.c.q_of_t
    sine = isinstance(q_of_t, Sine)
    return [Block(at.T_COORD, 1, e.values(), (own,), curve(q_of_t), sine)]


def curve(q_of_t: Table | Sine | Polynomial | None) -> tuple[tuple[float, ...], ...]:
    """The rows of `curves`; a table becomes a cubic spline that is at rest at both ends."""
    match q_of_t:
        case Sine(mean=mean, amplitude=amplitude, frequency=frequency, phase=phase):
            return ((mean, amplitude, frequency, phase, 0.0),)
        case Polynomial(coefficients=c):
            return ((0.0, *c, *(0.0,) * (4 - len(c))),)
        case Table(t=t, value=value):
            last = (t[-1], value[-1], 0.0, 0.0, 0.0)
            if len(t) == 1:
                return (last,)
            from scipy.interpolate import CubicSpline

            pieces = CubicSpline(t, value, bc_type="clamped").c[::-1].T
            return (*((x, *map(float, piece)) for x, piece in zip(t, pieces)), last)
    return ()


def _velocity(e: Ends) -> list[Block]:
    terms = [
        (at_v, -1, factor)
        for name, factors in (e.c.coefficients or {}).items()
        for (at_v, _), factor in zip(joint_coordinates(e.packed, e.topology.number(name)), factors)
        if factor
    ]
    return [Block(at.T_VELOCITY, 1, e.values(e.c.value or 0.0), tuple(terms))]


_KINDS: dict[str, Callable[[Ends], list[Block]]] = {
    "point": lambda e: [e.held()],
    "weld": lambda e: [e.held(), e.turned_as_at_home()],
    "revolute": _revolute,
    "prismatic": _prismatic,
    "cylindrical": _cylindrical,
    "universal": _universal,
    "distance": _distance,
    "line": _line,
    "plane": _plane,
    "orientation": lambda e: [e.turned_as_at_home()],
    "gear": _gear,
    "motion": _motion,
    "rolling": _rolling,
    "skate": _skate,
    "velocity": _velocity,
}

"""Lengths and moment arms of the forces along paths of a model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..engine.compiler.jit import ready
from ..engine.motion import path_arms
from ..errors import choices
from ..forces import BetweenPoints, Force, Spring, Within
from ..forces.path import length_along
from ..packing import Array, joint_coordinates
from ..packing.packed import Packed
from ..tolerances import SOLVED
from .scene import NO_CONSTRAINTS, Scene
from .ways import has_rows, no_ways, places_of, there

UNKEPT = "its force changes the energy there"  # a part of notices about jumps


class Paths:
    """The paths of the springs, struts and other forces along paths of a model, in its order."""

    def __init__(self, packed: Packed, forces: Sequence[Force] | None = None):
        """Pack a spring without a force along each path of these forces, or of the model's."""
        forces = packed.model.forces if forces is None else forces
        given = [f for f in forces if isinstance(f, BetweenPoints)]
        self.names = tuple(f.name for f in given)
        self._packed, self._rows = packed, [f for f in given if has_rows(f)]
        springs = tuple(_idle(f) for f in given)
        self._scene = Scene(packed, packed.passive, packed.loads(springs), NO_CONSTRAINTS)
        self._kernel, self._still = ready(path_arms), np.zeros(packed.nv)

    def measured(self, q: Array) -> tuple[Array, Array]:
        """Return the lengths (n,) [m] and the moment arms -dL/dq (n, nv) [m, 1] at q."""
        n, nv = len(self.names), len(self._still)
        lengths, arms = np.empty(n), np.zeros((n, nv))
        self._kernel(self._scene.address, q, self._still, lengths, arms)
        return lengths, arms

    def doubts(self, q: Array, arms: Array) -> Iterator[str]:
        """Yield a sentence about each path without a shortest way at q, with these moment arms."""

        def when(f: BetweenPoints) -> str:
            moving = arms[self.names.index(f.name)] != 0.0
            joints = [(n, x.q) for n, x in self._packed.joints.items() if moving[x.v].any()]
            places = (f"{name} {' '.join(f'{x:.6g}' for x in q[own])}" for name, own in joints)
            return f"at the coordinates {choices(places)}"

        return no_ways(self._packed, self._rows, q, when)


def _idle(f: BetweenPoints) -> Spring:
    """Return a spring of stiffness 0 along the path of a force."""
    path: dict[str, Any] = {name: getattr(f, name) for name in ("name", *BetweenPoints.PATH)}
    return Spring(**path, stiffness=0.0, rest=0.0)


class Jump(NamedTuple):
    """A jump of the length of a path, where a point of it begins or ceases to count."""

    force: BetweenPoints
    number: int  # number of the point in `via`, from 1
    when: Within
    at: float  # the coordinate [rad, m]
    size: float  # length with the point minus that without it [m]


def jumps_of(packed: Packed, f: BetweenPoints, q: Array) -> list[Jump]:
    """Return the jumps of a path at both ends of the ranges of its points, with all other
    coordinates as in q."""
    found = list[Jump]()
    for k, via in enumerate(f.via):
        for end in (via.when.low, via.when.high) if via.when is not None else ():
            assert via.when is not None, "it has a range"
            here, number = q.copy(), packed.topology.number(via.when.body)
            here[joint_coordinates(packed.system, number)[via.when.coordinate][1]] = end
            lengths = [
                length_at(
                    packed, f.unchecked_copy({"via": (*f.via[:k], *own, *f.via[k + 1 :])}), here
                )
                for own in ((via.unchecked_copy({"when": None}),), ())
            ]
            size = lengths[0] - lengths[1]
            if abs(size) > SOLVED * lengths[0]:
                found.append(Jump(f, k + 1, via.when, end, size))
    return found


def jump_text(packed: Packed, jumps: Sequence[Jump], when: str = "") -> str:
    """Return a sentence about the jumps of a path, of which there is one at least."""

    def place(jump: Jump) -> str:
        name = jump.when.body
        if packed.model.body(name).dof > 1:
            name += f".{jump.when.coordinate}"
        return f"by {1000 * abs(jump.size):.3f} mm where q of '{name}' is {jump.at:.6g}"

    f, points = jumps[0].force, choices(str(k) for k in sorted({x.number for x in jumps}))
    each = " and ".join(dict.fromkeys(map(place, jumps)))
    return (
        f"{f.kind} '{f.name}': its path jumps {each}{when}, at the end of the range of its point "
        f"{points}, so that {UNKEPT}; move the point onto the line between its neighbours, or end "
        "its range where it is on it"
    )


def length_at(packed: Packed, f: BetweenPoints, q: Array) -> float:
    """Return the length of the path of a force at a state [m]."""
    at, turned = places_of(packed, *packed.poses(q))
    return length_along(there(packed, f, q), packed.model.body(f.body), at, turned)

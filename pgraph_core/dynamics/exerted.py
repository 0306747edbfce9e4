"""Forces on bodies at given states: wrenches, sizes, tensions, and the spans of ropes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.cable_places import spans_of_segment
from ..engine.cables import GRIP
from ..engine.tree import bodies
from ..forces import OnBody
from ..model import Force
from ..packing import Array
from ..packing.forces import on_bodies
from ..packing.packed import Packed
from ..tolerances import EPS
from .scene import NO_CONSTRAINTS, Scene


def load_wrenches(packed: Packed, forces: tuple[Force, ...], t: Array, q: Array, v: Array) -> Array:
    """Return (n, nb, 6) [torque, force] on the bodies from the wrenches and springs in `forces`.

    The wrenches act at the body origins, in world axes, at n states and times t (n,). They are
    passed as `external`.
    """
    external = np.zeros((len(t), packed.nb, 6))
    if on_bodies(forces):
        own = packed.loads(tuple(on_bodies(forces)), named=forces)
        scene = Scene(packed, packed.passive, own, NO_CONSTRAINTS)
        for i in range(len(t)):
            state = (t[i], q[i], v[i], external[i])
            motion.load_wrenches(scene.address, *packed.system[2:4], *state)
    return external


def force_sizes(packed: Packed, forces: tuple[Force, ...], q: Array, v: Array) -> Array:
    """Return the sum (nv,) of the sizes of the generalised forces of gravity and of each force at
    t = 0.

    It is the scale of their rounding errors where they cancel. That of gravity is the weight of all
    bodies, times the length of the mechanism about hinges. q and v include the states of controls.
    """
    weight = sum(b.mass for b in packed.model.bodies) * math.hypot(*packed.model.gravity)
    found = np.where(packed.slides, weight, weight * packed.length)
    for f in forces:
        own = packed.loads(tuple(on_bodies((f,))), named=forces, states=True)
        scene, tau = Scene(packed, packed.drives((f,)), own, NO_CONSTRAINTS), np.zeros(len(v))
        motion.drive_torque(scene.address, q, v, tau)
        found += np.abs(tau[: packed.nv])
        motion.load_torque(scene.address, q, v, tau)
        found += np.abs(tau[: packed.nv])
    return found


def path_tensions(
    packed: Packed, force: OnBody, named: tuple[Force, ...], t: Array, q: Array, v: Array
) -> Array:
    """Return (n, rows, 3) tension, length and rate of a force along a path [N, m, m/s].

    It has a row for each segment of a cable, and otherwise one. Its expressions may name drives.
    """
    own = packed.loads((force,), named=named)
    scene = Scene(packed, packed.passive, own, NO_CONSTRAINTS)
    found = np.zeros((len(t), sum(len(table) for table, *_ in own.kinds), 3))
    for i in range(len(t)):
        motion.load_tensions(scene.address, t[i], q[i], v[i], found[i])
    cables = own.cable[0]
    if len(cables):
        length, rate = found[:, :, 1], found[:, :, 2]
        # a cable that is as long as without force, but for rounding of some spans, and becomes
        # longer, is taut in a run
        taut = (np.abs(length - cables["rest"]) <= 8.0 * EPS * np.abs(length)) & (rate > 0.0)
        found[:, :, 0] = np.where(taut, cables["damping"] * rate, found[:, :, 0])
    return found


def rope_spans(packed: Packed, block: int, q: Array) -> tuple[Array, Array]:
    """Return (n, spans, 9) first point, last point and direction of the spans of a block, and its
    lengths (n,), at the states q (n, nq)."""
    first, count = packed.blocks.blocks_i[block, [at.B_STATION, at.B_STATIONS]].tolist()
    return spans_over(packed, packed.blocks.stations[first : first + count], q)


def spans_over(packed: Packed, stations: Any, q: Array) -> tuple[Array, Array]:
    """Return (n, spans, 9) first point, last point and direction of the spans of a segment, and its
    lengths (n,), at the states q (n, nq).

    The lengths are without what lies on the wheels that it grips at its ends.
    """
    system = packed.system
    found, lengths = np.zeros((len(q), len(stations) - 1, 9)), np.zeros(len(q))
    work = np.zeros((len(packed.rows), at.WORK))
    position, rotation = np.empty((packed.nb, 3)), np.empty((packed.nb, 9))
    for i in range(len(q)):
        bodies.poses(*system[:4], q[i], np.zeros(packed.nv), work, position, rotation)
        lengths[i] = spans_of_segment(stations, work, q[i], found[i])
    for one, sign in ((stations[0], 1.0), (stations[-1], -1.0)):
        if one["shape"] == GRIP:
            lengths += sign * one["radius"] * one["gear"] * q[:, one["coordinate"]]
    return found, lengths

"""Instances that stand or walk on a plane, side by side in lanes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..engine import layout as at
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.compiler.jit import JIT, ready
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.lockstep import block as columns
from ..engine.lockstep import walk as walks
from ..engine.lockstep.step import step_lanes
from ..engine.motions import facts
from ..engine.records import BOX, CAPSULE, POINTS, RIGID, SPHERE
from ..engine.stepping import run
from ..gait.controller import GaitTorque
from ..packing import Array, Ints
from ..simulation.stepper import Stepper
from .instances import COPY, Instances

OF_VERTICES = (POINTS, SPHERE, CAPSULE, BOX)  # shapes that touch a plane by balls at vertices
LOCATED = 64  # shapes: impacts of more are not located one by one


def on_feet(stepper: Stepper) -> bool:
    """Return True for a single tree of hinges and sliders whose shapes touch only a plane.

    The drives must be springs, dampers, motors or servos of a single coordinate, with constant
    inputs.
    """
    scene = stepper.recording.scene
    stepped = JIT and stepper.recording.plan.method.time_stepping
    if not stepped or scene.touching is None or scene.active[0]:
        return False
    contacts, rows = scene.touching.contacts, scene.packed.rows
    may, shapes, tally = contacts.candidates, contacts.geometry.shapes, scene.touching.tally
    among = len(may.pairs) + len(may.members) + len(contacts.ground.patches) + scene.loads.number
    if (
        among
        or len(scene.loads.signals[0])
        or tally["limits"]
        or tally["frictions"]
        or tally["first_turn"] >= 0
        or (contacts.laws["law"] != RIGID).any()
    ):
        return False
    each = len(np.unique(may.on_ground["shape"])) == len(may.on_ground) == len(shapes) <= LOCATED
    kinds, roots = rows[1:, at.KIND], rows[1:, at.PARENT] == 0
    single = facts("freedoms")[kinds] == 1
    one = len(kinds) > 1 and roots.sum() == 1 and (single[0] or not facts("transmits")[kinds[0]])
    return bool(
        each
        and one
        and single[1:].all()
        and np.isin(shapes["kind"], OF_VERTICES).all()
        and not shapes["moves"].any()
        and all(is_plain(row) for row in scene.drives.table)
    )


def is_plain(row: Any) -> bool:
    """Check whether a drive has a single coordinate and constant inputs without lag."""
    follows = row["terms"] or row["lag"] or row["integrates"]
    return not follows and row["torques"] <= 1 and (row["coordinate"] < 0 or row["targets"] <= 1)


class FeetLanes(Instances):
    """Instances stepped side by side in lanes, bitwise identical to separate runs."""

    together = LANE_WIDTH

    def prepare(self) -> None:
        """Name the points and drives, and allocate one block per worker."""
        stepper = self.workers[0].stepper
        user = stepper.recording.user
        self._memory = 0 if user is None else len([a for a in user.memory if a.size])
        self._ways, self._drives = _ways(stepper), drives_of(stepper)
        self._room = [_room(worker.stepper, self._ways) for worker in self.workers]
        self._walks = [_walk(w.stepper, room[1]) for w, room in zip(self.workers, self._room)]
        ready(step_lanes)

    def _part(self, n: int, number: int, *span: int) -> None:
        if n == 0:
            super()._part(n, number, *span)
            return
        worker = self.workers[number]
        near, block, frames, lanes = self._room[number]
        walk, place, fallen, _ = self._walks[number]
        step_lanes(
            worker.run, address_of(run.advance_run), COPY, worker.own, worker.numbers,
            self._memory, self._ways, near, self._drives, block, frames, lanes, self._tables(),
            self.kind, self.codes, n, *span, walk, address_of_array(place), fallen,
        )  # fmt: skip


def _ways(stepper: Stepper) -> Ints:
    """Return the body of each vertex, and the joints between it and the ground."""
    scene = stepper.recording.scene
    assert scene.touching is not None
    contacts, rows = scene.touching.contacts, scene.packed.rows
    found: list[list[int]] = []
    for shape, pair in contacts.candidates.on_ground[["shape", "pair"]].tolist():
        one = contacts.geometry.shapes[shape]
        joints = joints_to_ground(rows, int(one["row"]))
        for vertex in range(int(one["vertices"])):
            place = int(one["first_vertex"]) + vertex
            known = shape, int(one["row"]), int(one["body"]), pair, place, vertex, int(one["kind"])
            found.append([*known, len(joints), *joints])
    width = max(map(len, found))
    return np.array([way + [0] * (width - len(way)) for way in found], dtype=np.int64)


def joints_to_ground(rows: Ints, k: int) -> list[int]:
    """Return the indices into v of the joints between row k and the ground, as for a free body."""
    joints: list[int] = []
    while k > 0:
        kind, first = rows[k, at.KIND], int(rows[k, at.VI])
        joints += range(first, first + int(facts("freedoms")[kind]))
        k = int(rows[k, at.PARENT]) if facts("transmits")[kind] else 0
    return joints


def drives_of(stepper: Stepper) -> Ints:
    """Return (n, 3): the index into v, the index into q or -1, and 1 per spring or damper."""
    drives = stepper.recording.scene.drives
    passive = np.arange(len(drives.table)) < drives.passive
    rows = drives.table["velocity"], drives.table["coordinate"], passive
    return np.stack(rows, axis=1).astype(np.int64)


def _room(stepper: Stepper, ways: Ints) -> tuple[Ints, tuple[Array, ...], Array, Ints]:
    """Return one worker's buffers: (geometry, block, frames by lane, lane continuation)."""
    scene, steps = stepper.recording.scene, stepper.recording.steps
    assert scene.touching is not None
    contacts, n = scene.touching.contacts, len(scene.packed.rows)
    points, pairs, wide = len(ways), len(contacts.laws), max(len(steps.q), len(steps.v), 2)
    shapes = (
        (n, at.CONST), (n, at.WORK), (n, 3), (columns.VECTOR.total, wide),
        (len(scene.drives.table), columns.DRIVE.total),
        (len(contacts.geometry.shapes), columns.SHAPE.total), contacts.geometry.vertices.shape,
        (pairs, 2), (len(contacts.bodies_f), 3), (points, columns.POINT.total),
        (points, 3 * (ways.shape[1] - columns.WAY.joint)), (points, 9),
        (pairs, columns.PAIR.total), (len(contacts.wrenches), 6), (1, columns.LANE.total),
    )  # fmt: skip
    block = tuple(np.zeros((*shape, LANE_WIDTH)) for shape in shapes)
    frames = np.zeros((LANE_WIDTH, n, at.WORK))
    return np.zeros(points + 1, dtype=np.int64), block, frames, np.zeros((3, LANE_WIDTH), np.int64)


def _walk(stepper: Stepper, block: tuple[Array, ...]) -> tuple[int, Array, Array, Any]:
    """Return (controller address in lanes or 0, its stored tuple, times of falls, the tuple)."""
    user, nothing = stepper.recording.user, np.zeros(0)
    if not isinstance(user, GaitTorque) or not user.kept.theirs.size or user.kept.terrain.x.size:
        return 0, nothing, nothing, None
    kept, nv = user.kept, len(user.kept.v)
    settings, legs, feet = (
        x.view(np.float64).reshape(len(x), -1) for x in (kept.settings, kept.legs, kept.feet)
    )
    own = settings, legs, kept.waves, kept.limit.reshape(1, nv)
    lanes = [np.zeros((*x.shape, LANE_WIDTH)) for x in (*own, feet, kept.matrix, kept.work)]
    place = buffer()
    arrays = kept.rows, kept.spine, *own, *lanes, *block[:4], block[-1]
    walk = walks.WalkOfLanes._make(arrays)
    ready(walks.save_walk_of_lanes)(place, unnamed(walk))
    return address_of(walks.walk_in_lanes), place, kept.fallen, walk

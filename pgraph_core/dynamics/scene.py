"""Scene: a mechanism with its forces and constraints, and the kernel workspaces."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine import arrays, motion
from ..engine import layout as at
from ..engine.arrays import (
    FACTORED,
    FACTORS,
    LEAST,
    LOOSE,
    VECTORS,
    Contacts,
    Islands,
    Links,
    User,
    Workspace,
)
from ..engine.compiler.address import address_of, address_of_array, buffer, unnamed
from ..engine.motions import facts
from ..engine.records import (
    BODY_WRENCH,
    CONTACT,
    CONTACT_TALLY,
    DIP,
    KEPT,
    MEETING,
    PAIR,
    PHASE_CHANGE,
    POSE,
    RIGID,
    WATCH,
    table,
)
from ..engine.signals import LAW
from ..engine.stepping.measured import measured
from ..model import Contact
from ..packing import Array, Drives, Ints, Loads
from ..packing.constraints import Blocks
from ..packing.packed import Packed
from ..packing.programs import locate_forces, measured_rows, with_pairs
from ..portable import Unportable
from ..pulleys import segment_names

if TYPE_CHECKING:
    from ..contact.tables import Tables
    from .arguments import UserTorque

NO_CONSTRAINTS = np.zeros(0, dtype=np.int64)
NO_GAINS = np.zeros(2)
NO_USER = User(0, np.zeros((0, 0)), np.zeros(0, dtype=np.int64))


class Scene(Unportable):
    """The run data for kernels behind a single `address`, used by one thread at a time.

    `active` and `given` (nv,), additional torques, may change between calls.
    """

    once = True  # each step is taken once

    def __init__(
        self,
        packed: Packed,
        drives: Drives,
        loads: Loads,
        active: Ints,
        *,
        contacts: Tables | None = None,
        gains: Array = NO_GAINS,
        user: UserTorque | None = None,
        blocks: Blocks | None = None,
    ):
        """Make a scene with constraints `active` (indices) of `blocks`, by default the model's."""
        if len(loads.signals[0]):  # values are written here, and other runs share the arrays
            drives, loads = apart(drives, loads)
        if contacts and contacts.frictions:  # its blocks take the place of the regularised law
            drives = drives._replace(table=drives.table.copy())
            drives.table["friction"] = 0.0
        packed = packed.run if len(loads.signals[2]) else packed
        self.packed, self.drives, self.loads = packed, drives, loads
        self.rubs = rubs(drives)
        own = packed.blocks if blocks is None else blocks
        if (own.blocks_i[:, at.B_KNOTS] < at.SINE).any():
            own = own._replace(curves=own.curves.copy())
        if (own.blocks_i[:, at.B_TYPE] == at.T_CURVE).any():  # they keep where their points are
            own = own._replace(blocks_f=own.blocks_f.copy())
        self.blocks: Blocks = _extended(own, contacts) if contacts else own
        code, targets, states = loads.signals
        if len(measured_rows(code)) or (targets[:, 1] == LAW).any():
            pairs = contacts.measured(packed.model) if contacts else []
            locate_forces(code, own.first.tolist(), pairs)
            loads = self.loads = loads._replace(signals=(code, with_pairs(targets, pairs), states))
            contacts = contacts and contacts._replace(laws=contacts.laws.copy())
        self.active = np.zeros(len(self.blocks.blocks_i) + 1, dtype=np.int64)
        self.given = np.zeros(packed.nv)
        self.user, self.gains = user, gains
        self.work = np.zeros((max(len(packed.rows), loads.rows), at.WORK))
        before = len(own.blocks_i)
        self.touching = (
            ContactSpace(packed, contacts, self.blocks, before, steps=self.once)
            if contacts
            else None
        )
        # whether contacts or constraints keep something from one evaluation to the next
        self.remembers = self.touching is not None or len(self.blocks.blocks_i) > 0
        imposed = address_of(motion.constrain) if len(self.blocks.blocks_i) else 0
        links = self.touching.links if self.touching else Links()
        self.space = workspace(packed.rows, packed.nq, packed.nv, self.blocks, active, contacts)
        if len(self.work) > len(packed.rows):  # points that ride have velocities, too
            self.space = self.space._replace(linear=np.zeros((len(self.work), 3)))
        self._spans: list[tuple[str, int, int]] = []
        self._one_each: list[str] = []  # their names if each has one block, in order
        if len(self.blocks.blocks_i):
            self.activate(active)
        tables = arrays.Blocks(*self.blocks[2:], self.active)
        if user is not None:
            user.join(packed, self.work)
        acts = NO_USER if user is None else User(user.address, user.exchange, user.answer)
        rows, const = packed.rows, packed.const
        if contacts:  # contacts count stiff drives as inertia
            const = const.copy()
        self._kept = arrays.Scene(
            rows, const, drives, loads, tables, self.work, self.space, gains, self.given, acts,
            links._replace(constraints=imposed),
        )  # fmt: skip
        self._buffer = buffer()
        motion.save_scene(self._buffer, unnamed(self._kept))
        self.address = address_of_array(self._buffer)

    @cached_property
    def accelerate(self) -> int:
        """The address of the kernel that computes v' in a scene."""
        return address_of(motion.acceleration)

    @property
    def arrays(self) -> arrays.Scene:
        """The scene as kernels take it."""
        return self._kept

    def solve_tighter(self) -> None:
        """Halve the tolerances of solver and gaps, in a run that is compared with another to
        estimate its error."""
        if self.touching is not None:
            self.touching.tally["fine"] = 0.5
            first, count = (int(self.touching.tally[x]) for x in ("first_limit", "limits"))
            self.blocks.blocks_f[first : first + count, at.SIZE] *= 0.5

    @property
    def numbers(self) -> list[Array]:
        """Arrays of the description. `blocks_f` also contains states."""
        kept, packed = self._kept, self.packed
        found: list[Any] = [kept.rows, kept.const, packed.const, kept.gains, *packed.system[2:4]]
        found += [kept.drives.table, kept.drives.knots, kept.drives.terms]
        found += [array for own in kept.loads for array in own]
        found += [kept.blocks.blocks_i, *kept.blocks[2:5]]
        if self.touching is not None:
            found += self.touching.numbers
        return found if self.user is None else found + self.user.numbers

    def activate(self, constraints: Ints) -> None:
        """Activate the blocks of these constraints, and no others."""
        spans = self._spans = _spans_of(self.blocks, constraints)
        one_each = all(span[1:] == (i, i + 1) for i, span in enumerate(spans))
        self._one_each = [name for name, _, _ in spans] if one_each else []
        chosen = [block for _, *span in self._spans for block in range(*span)]
        self.active[0] = len(chosen)
        self.active[1 : len(chosen) + 1] = chosen
        self.space.vectors[LEAST] = np.inf
        self.space.vectors[FACTORED, FACTORS.known] = 0.0  # the last factors were of other blocks
        self.space.dips[:] = 0
        self.space.watch[:] = 0
        self.space.watch["rows"] = self.blocks.blocks_i[chosen, at.B_SIZE].sum()

    def switch(self, constraints: Ints) -> None:
        """Activate these constraints during a run."""
        self.activate(constraints)

    def forget(self, constraints: Ints) -> None:
        """Reset the memory and activate these constraints, for scenes without contacts."""
        for kept in self.space:
            kept[:] = 0
        self.activate(constraints)

    def begin_controls(self, t: float, near: float, q: Array, v: Array) -> None:
        """Give the states of controls their first values at t, and take the samples within `near`.

        Samples read the forces of the first values.
        """
        if len(measured_rows(self.loads.signals[0])):
            motion.begin_controls(self.address, t, -1.0, q, v)
            forces = np.zeros((len(self.blocks.blocks_i), 6))
            state = t, q, v, np.zeros(len(v)), np.zeros(3)
            measured(self.address, self.accelerate, *state, forces)
        motion.begin_controls(self.address, t, near, q, v)

    @property
    def held(self) -> int:
        """Address of the scene whose active blocks are used for projection."""
        return self.address

    @property
    def spans(self) -> list[tuple[str, int, int]]:
        """The name, first block and end of the blocks of every active constraint."""
        return self._spans

    def forces(self, wrenches: Array) -> dict[str, Array]:
        """Return {name: (..., 6)} [torque, force] on `body` at `point` of the active constraints,
        from wrenches (blocks, ..., 6).
        """
        if self._one_each:
            return dict(zip(self._one_each, wrenches))
        named = (own for one in self._spans for own in _segments_of(self.blocks, *one))
        return _summed(wrenches, named)


def forces_of(blocks: Blocks, constraints: Ints, wrenches: Array) -> dict[str, Array]:
    """Return {name: (n, 6)} [torque, force] on `body` at `point` of these constraints, from
    wrenches (n, blocks, 6).

    A rope has an entry "name[k]" for each of several segments, with the force on their first body.
    """
    spans = _spans_of(blocks, constraints)
    named = (own for one in spans for own in _segments_of(blocks, *one))
    return _summed(np.ascontiguousarray(wrenches.swapaxes(0, 1)), named)


def _segments_of(blocks: Blocks, name: str, first: int, end: int) -> list[tuple[str, int, int]]:
    """Return the spans of the entries of a constraint."""
    if end == first + 1 or blocks.blocks_i[first, at.B_TYPE] != at.T_CABLE:
        return [(name, first, end)]
    return [(own, i, i + 1) for own, i in zip(segment_names(name, end - first), range(first, end))]


def _spans_of(blocks: Blocks, constraints: Ints) -> list[tuple[str, int, int]]:
    """Return the name, first block and end of the blocks of each of these constraints."""
    first = blocks.first.tolist()
    return [(blocks.names[i], first[i], first[i + 1]) for i in constraints.tolist()]


def _summed(wrenches: Array, spans: Iterable[tuple[str, int, int]]) -> dict[str, Array]:
    return {name: wrenches[a] if b == a + 1 else wrenches[a:b].sum(axis=0) for name, a, b in spans}


def empty_frames(
    n: int, size: tuple[int, int], blocks: int, nb: int, touches: int, *, means: bool = False
) -> arrays.Frames:
    """Return arrays for n frames of a run with a state of this size (nq, nv).

    `blocks` is the number of blocks of constraints, and `touches` that of contact pairs and limits,
    which act on `nb` bodies. Without contacts and limits, `nb` is 0. With `means`, constraints have
    their mean wrenches beside those at the frames.
    """
    nq, nv = size
    touched = n if nb else 0
    return arrays.Frames(
        q=np.zeros((n, nq)),
        v=np.zeros((n, nv)),
        vdot=np.zeros((n, nv)),
        wrenches=np.zeros((n, blocks, 2 * motion.MEANS if means else motion.MEANS)),
        energies=np.zeros((n, 4)),
        drifts=np.zeros((n, 2)),
        pushes=np.zeros((touched, nb, 6)),
        pairs=table(PAIR, touched, touches),
        missed=np.zeros((touched, 3)),
    )


def apart(drives: Drives, loads: Loads) -> tuple[Drives, Loads]:
    """Copy the drives and loads, so that expression values are written to separate arrays."""
    own = ((table, knots.copy(), vias) for table, knots, vias in loads.kinds)
    *points, gates = loads.riders
    loads = Loads(*own, (*points, gates.copy()), tuple(array.copy() for array in loads.signals))
    return drives._replace(table=drives.table.copy(), knots=drives.knots.copy()), loads


class ContactSpace(Unportable):
    """The contacts in a scene as one record, with the state that they keep between steps."""

    def __init__(
        self, packed: Packed, contacts: Tables, blocks: Blocks, first: int, *, steps: bool
    ):
        """Create the contact space. `first` is the number of `blocks` preceding those for contacts.

        If `steps` is True, no step is repeated, so its contact history can be stored.
        """
        from ..contact import packed_shapes
        from ..engine.contact import contacts as kernels  # compiled only if something touches

        n, count, limits = len(contacts.touches), contacts.room, len(contacts.limits)
        tally = table(CONTACT_TALLY, 1)
        self.tally_table, self.tally = tally, tally[0]
        self.tally["frictions"] = contacts.frictions
        first += contacts.frictions
        self.tally["first_limit"], self.tally["limits"] = first, limits
        self.tally["first_contact"] = first + limits
        self.tally["first_turn"] = first + limits + count if contacts.turns else -1
        self.tally["length"], self.tally["fine"] = packed.length, 1.0
        self.tally["pull"] = np.linalg.norm(packed.model.gravity)
        self.changes = table(PHASE_CHANGE, max(MOST_CHANGES, 2 * (n + limits)))
        self.pairs = pairs = table(PAIR, n + limits)
        pairs["phase"] = -1
        compliant = bool((contacts.laws["law"] != RIGID).any())
        factored = np.zeros((len(packed.rows) if compliant else 0, at.WORK))
        self._kept = Contacts(
            geometry=contacts.geometry,
            ground=contacts.ground,
            candidates=contacts.candidates,
            poses=table(POSE, len(contacts.geometry.shapes)),
            start_poses=table(POSE, len(contacts.geometry.shapes)),
            search=packed_shapes.search_space(contacts.geometry, len(contacts.candidates.members)),
            found=table(CONTACT, count),
            laws=contacts.laws,
            kept=table(KEPT, count),
            before=table(KEPT, count),
            anchors=table(KEPT, count if compliant else 0),
            meetings=table(MEETING, count + limits + MOST_MEETINGS),
            wrenches=table(BODY_WRENCH, packed.nb + 1),
            pairs=pairs,
            tally=tally,
            bodies_i=packed.system.bodies_i,
            bodies_f=packed.system.bodies_f,
            limit_tau=np.zeros(packed.nv),
            changes=self.changes,
            islands=islands(packed.rows, packed.nv, blocks),
            factored=factored,
        )
        self.shapes, self.found = contacts.geometry.shapes, self._kept.found
        self.pairs = pairs  # results of each pair in the last step
        kept = self._kept
        # what steps and records read before they write it
        self.memory = [kept.found, kept.kept, kept.anchors, kept.wrenches]
        self.memory += [kept.pairs, tally, kept.limit_tau]
        self._buffer = buffer()
        kernels.save_contacts(self._buffer, unnamed(self._kept))
        self.links = Links(
            contacts=address_of_array(self._buffer),
            find=address_of(kernels.find),
            forces=address_of(kernels.contact_forces),
            record=address_of(kernels.record_contacts),
            settle=address_of(kernels.settle_contacts) if steps else 0,
        )

    @property
    def contacts(self) -> Contacts:
        """The contact data for kernels."""
        return self._kept

    @property
    def conflict(self) -> Array:
        """The impulses of all blocks in the last conflict, which no velocities satisfy."""
        return self._kept.islands.pushed[:, 2]

    @property
    def described(self) -> tuple[Any, ...]:
        """The geometry, the ground and the contact laws."""
        return self._kept.geometry, self._kept.ground, self._kept.laws

    @property
    def numbers(self) -> list[Array]:
        """The arrays from the description."""
        kept = self._kept
        found = [*kept.geometry, *kept.ground, *kept.candidates]
        return [*found, kept.laws, kept.bodies_i, kept.bodies_f]

    def begin_log(self, t: float) -> Any:
        """Start counting and logging, and return the current phases as changes at t."""
        names = "fallbacks", "calmed", "overflows", "logged", "cuts", "crowded", "residual", "depth"
        for name in (*names, "strayed", "chains", "loose"):
            self.tally[name] = 0
        phases = self._kept.pairs["phase"]
        now = table(PHASE_CHANGE, len(phases))
        now["time"] = now["when"] = t
        now["pair"], now["phase"] = np.arange(len(phases)), phases
        return now[phases >= 0]


FILL = 38  # 4 x 4 blocks a row of the contact solver's factor: islands with more are swept


def islands(rows: Ints, nv: int, blocks: Blocks) -> Islands:
    """Allocate buffers in the contact solver."""
    from ..engine.contact.islands import GRAPH, SIZES  # compiled only if something touches
    from ..engine.contact.sweeps import NORMAL_ROWS, SWEPT

    n, count = len(rows), len(blocks.blocks_i)
    fours = nv // 4 + n  # a tree may begin with a new one
    reached = count * min(fours, path_width(rows, nv, blocks))
    room = min(fours * (fours + 1) // 2, FILL * fours) + fours
    return Islands(
        tree=_integers(nv),
        root=_integers(n),
        head=_integers(n),
        below=_integers(n),
        chief=_integers(n),
        number=_integers(n),
        edge=_integers(n),
        edges=_integers(8 * count, 2),
        blocks=_integers(count),
        first=_integers(count + 2),
        graph=_integers(n, GRAPH.total),
        queue=_integers(n),
        size=_integers(SIZES.total),
        freedoms=_integers(4 * fours),
        place=np.full(nv, -1),
        start=_integers(fours + 1),
        column=_integers(room),
        waiting=_integers(fours),
        after=_integers(fours + count),
        upper=np.zeros((room, 16)),
        lower=np.zeros((room, 16)),
        change=np.zeros((fours, 4)),
        speeds=np.zeros((fours, 4)),
        free=np.zeros((fours, 4)),
        path=np.zeros((fours, 4)),
        scale=np.zeros(4 * fours),
        across=np.zeros((reached, 12)),
        reached=_integers(reached),
        fours=_integers(count + 1),
        pushed=np.zeros((count, 3)),
        slope=np.zeros((count + NORMAL_ROWS, SWEPT.total)),
        weight=np.zeros(count),
        mobility=np.zeros(count),
    )


def _integers(*shape: int) -> Ints:
    return np.zeros(shape, dtype=np.int64)


MOST_DIPS = 8  # limit on recorded dips of pivots of constraints
MOST_MEETINGS = 64  # room for meetings in a step in addition to the number of contacts
MOST_CHANGES = 4096  # room for changes of phases between two readings


def contact_tables(packed: Packed, active: tuple[Contact, ...]) -> Tables | None:
    """Return the tables for these contacts and the joint limits, or None if there are neither."""
    if not active and not packed.model.limited:
        return None
    from ..contact.tables import tables

    return tables(packed, active)


def stepped_tables(packed: Packed, contacts: Tables | None, drives: Drives) -> Tables | None:
    """Return these tables with joint friction added, for time stepping."""
    if not rubs(drives):
        return contacts
    from ..contact.tables import tables, with_friction

    return with_friction(contacts or tables(packed, ()), drives, packed.rows)


def rubs(drives: Drives) -> bool:
    """Check whether a joint or tendon has friction."""
    return bool((drives.table["friction"] > 0.0).any())


def _extended(own: Blocks, contacts: Tables) -> Blocks:
    from ..contact.tables import extended

    return extended(own, contacts)


def segments_of(blocks: Blocks, name: str) -> list[tuple[str, int]]:
    """Return the name and the block of each segment of a rope."""
    k = blocks.names.index(name)
    first, end = blocks.first[k : k + 2].tolist()
    return [(own, i) for own, i, _ in _segments_of(blocks, name, first, end)]


def workspace(
    rows: Ints, nq: int, nv: int, blocks: Blocks, active: Ints, contacts: Tables | None
) -> Workspace:
    """Allocate the constraint kernels' workspace for the maximum number of active rows."""
    count, n, m = len(blocks.blocks_i), len(rows), 0
    for i in active.tolist():
        m += int(blocks.blocks_i[blocks.first[i] : blocks.first[i + 1], at.B_SIZE].sum())
    most = m
    if contacts is not None:
        points = contacts.room * (2 if contacts.turns else 1)
        most = m + contacts.frictions + len(contacts.limits) + 3 * points
    m = -(-m // 3) * 3  # whole blocks of three
    width = path_width(rows, nv, blocks) if count else 0
    return Workspace(
        y=np.zeros((count, 3 * width)),
        slots=np.zeros((count, width + at.SLOT), dtype=np.int64),
        omega=np.zeros((m, m)),
        factor=np.zeros((m, m)),
        place=np.zeros((count, at.PLACE)),
        vectors=np.zeros((VECTORS, max(most + 2, nq, nv, LOOSE + 1))),
        linear=np.zeros((n, 3)),
        carried=np.zeros((n, 6)),
        watch=table(WATCH, 1),
        dips=table(DIP, MOST_DIPS if count else 0),
        dip_states=np.zeros((MOST_DIPS if count else 0, nq + nv)),
        nulls=np.zeros((m, m)),
        where=np.zeros(nv, dtype=np.int64),
        own=np.zeros((count, 9)),
    )


def path_width(rows: Ints, nv: int, blocks: Blocks) -> int:
    """Compute the maximum number of degrees of freedom on a block's two paths to the ground."""
    if np.any(blocks.blocks_i[:, at.B_TERMS] > 0) or len(blocks.stations):
        return nv
    depth = [0] * len(rows)
    size = facts("freedoms").tolist()
    for k, (parent, kind, *_) in enumerate(rows[1:].tolist(), start=1):
        depth[k] = size[kind] + depth[parent]
    return min(nv, 2 * max(depth))

"""A memory image of a run with one method, which the WebAssembly kernels step.

Pointers take 4 bytes there. Numbers and records have the same format, but array descriptors and
addresses differ. Arrays that share memory in Python also share memory in the figure.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import CONTACTS, RUN, SCENE, Links, RunLinks
from ..engine.compiler.address import address_of
from ..engine.compiler.kinds import Array, Group
from ..engine.records import CHOSEN, GIVEN, STEP_CONTROL, offsets, table
from ..engine.stepping import crossings
from ..errors import InputError, Problem, choices
from ..forces import spring
from ..integrators import METHODS, RK4
from ..mechanism import Mechanism
from ..model import Force
from ..simulation.options import Options
from ..simulation.plan import plan_of, with_contacts
from ..simulation.recording import Recording
from ..simulation.start import with_state

ALIGNED = 16  # [bytes] alignment of vectors of two doubles
ARRAY, AXIS = 32, 16  # [bytes] size of the struct of an array, and per axis
# in that struct: number of entries, bytes of each, place of the data, then shape and strides
ENTRIES, ENTRY, DATA, SHAPE = 8, 16, 24, 32


class Root(NamedTuple):
    """A struct that the kernels access by address."""

    kind: Any  # type of its members
    value: Any  # named tuple
    within: Any = None  # array that holds the struct, None if the struct stands alone
    skip: int = 0  # [bytes] from the start of that array


class Image:
    """The layout and the bytes of the structs and arrays that start at address `base`."""

    def __init__(self, base: int, roots: Mapping[str, Root], others: Iterable[Any] = ()):
        """Set up the layout. `others` are arrays outside structs. Nothing is written yet."""
        self.base, self._roots = base, roots
        arrays = [a for root in roots.values() for a in _arrays(root.kind, root.value)]
        arrays += [*others, *(r.within for r in roots.values() if r.within is not None)]
        self._begins, self._ends = _spans(arrays)
        top, self.at = base, dict[str, int]()
        for name, root in roots.items():
            if root.within is None:
                self.at[name], top = top, _aligned(top + size_of(root.kind))
        self._places = [0] * len(self._begins)  # sorted like the arrays, so every image is the same
        for k in dict.fromkeys(self._span_of(a) for a in arrays if a.nbytes):
            self._places[k] = top
            top = _aligned(top + self._ends[k] - self._begins[k])
        self.size = top - base
        for name, root in roots.items():
            if root.within is not None:
                self.at[name] = self.place(root.within) + root.skip

    def place(self, array: Any) -> int:
        """Return the address of the first entry in an array."""
        k, address = self._span_of(array), _address(array)
        if array.nbytes == 0 and (k < 0 or not address < self._ends[k]):
            return self.base  # an empty array is not the begin of another one
        assert address + array.nbytes <= self._ends[k], "not in the image"
        return self._places[k] + address - self._begins[k]

    def _span_of(self, array: Any) -> int:
        return int(np.searchsorted(self._begins, _address(array), side="right")) - 1

    def name_of(self, address: int) -> str:
        """Return a readable name for the struct whose array contains an address."""
        for name, root in self._roots.items():
            for path, array in _named(root.kind, root.value):
                place = self.place(array)
                if array.nbytes and place <= address < place + array.nbytes:
                    return f"numbers of the {name} ({path})"
        return "numbers of the run"

    def bytes(self, changed: Mapping[str, Any]) -> bytearray:
        """Return the memory, with `changed` values of structs (links, addresses)."""
        found = bytearray(self.size)
        for begin, end, place in zip(self._begins, self._ends, self._places):
            found[place - self.base : place - self.base + end - begin] = _memory(begin, end)
        for name, root in self._roots.items():
            if root.within is not None:  # replaces the struct of this machine
                at, size = self.at[name] - self.base, root.within.nbytes - root.skip
                found[at : at + size] = bytes(size)
            self._write(found, root.kind, changed.get(name, root.value), self.at[name] - self.base)
        return found

    def _write(self, out: bytearray, kind: Any, value: Any, at: int) -> int:
        """Write a value at an offset and return the offset of the next value."""
        if isinstance(kind, Group):
            for member, part in zip(kind.members, value):
                at = self._write(out, member, part, at)
            return at
        if isinstance(kind, Array):
            place = self.place(value)
            head = np.zeros(ARRAY // 8 + 2 * kind.ndim, dtype=np.int64)
            head[ENTRIES // 8], head[ENTRY // 8] = value.size, value.itemsize
            head[DATA // 8] = place
            # of a contiguous array, even for axes of length 0 or 1
            strides, step = [], value.itemsize
            for n in reversed(value.shape):
                strides.insert(0, step)
                step *= n
            head[SHAPE // 8 :] = *value.shape, *strides
            out[at : at + head.nbytes] = head.tobytes()
            return at + head.nbytes
        out[at : at + 8] = np.int64(value).tobytes()
        return at + 8


def size_of(kind: Any) -> int:
    """Return the size of a struct of this type [bytes]."""
    if isinstance(kind, Group):
        return sum(map(size_of, kind.members))
    return ARRAY + AXIS * kind.ndim if isinstance(kind, Array) else 8


def offset_of(kind: Any, *path: str) -> int:
    """Return the byte offset of a named-tuple field within the corresponding struct."""
    at = 0
    for name in path:
        k = kind.fields.index(name)
        at += sum(size_of(member) for member in kind.members[:k])
        kind = kind.members[k]
    return at


def _arrays(kind: Any, value: Any) -> list[Any]:
    if isinstance(kind, Group):
        return [a for member, part in zip(kind.members, value) for a in _arrays(member, part)]
    return [value] if isinstance(kind, Array) else []


def _named(kind: Any, value: Any, path: str = "") -> list[tuple[str, Any]]:
    if isinstance(kind, Group):
        names = kind.fields if kind.names else range(len(value))
        parts = zip(names, kind.members, value)
        return [found for n, k, v in parts for found in _named(k, v, f"{path}.{n}".strip("."))]
    return [(path, value)] if isinstance(kind, Array) else []


def _address(array: Any) -> int:
    return array.__array_interface__["data"][0]


def _spans(arrays: Iterable[Any]) -> tuple[list[int], list[int]]:
    """Return the start and end addresses of arrays, merging overlapping arrays."""
    begins: list[int] = []
    ends: list[int] = []
    for begin, end in sorted((_address(a), _address(a) + a.nbytes) for a in arrays if a.nbytes):
        if ends and begin < ends[-1]:
            ends[-1] = max(ends[-1], end)
        else:
            begins.append(begin)
            ends.append(end)
    return begins, ends


def _memory(begin: int, end: int) -> bytes:
    return ctypes.string_at(begin, end - begin)


def _aligned(address: int) -> int:
    return -(-address // ALIGNED) * ALIGNED


# -- runs ------------------------------------------------------------------------------------------

BASE = 1 << 21  # [bytes] address of images: above the stack and the constants of the kernels
# methods of a figure
SMOOTH = RK4.name, *(m.name for m in METHODS.values() if m.explicit and m is not RK4)
TOUCHING = tuple(m.name for m in METHODS.values() if m.time_stepping)
LOADS, CORNERS = offset_of(SCENE, "loads", "spring"), offset_of(RUN, "corners")
MOST_LIVE_STEPS = 100_000_000  # limit on the steps of a reader's run


CONTROL = offsets(STEP_CONTROL)
NO_LINKS, NO_RUN_LINKS = Links(), RunLinks(0, 0, 0, 0)


class Setup(NamedTuple):
    """Arguments for a run in addition to the mechanism."""

    scenario: str | None = None
    step: float = 1e-3  # [s]
    t_start: float = 0.0  # [s]
    state: tuple[Any, Any] | None = None  # (q, v), None for that of the scenario or the model
    forces: tuple[Force, ...] = ()  # besides the model's and the scenario's

    def options(self, method: str | None) -> Options:
        """Return options for a run with two frames after the start, the next one and the end."""
        adaptive = method in METHODS and METHODS[method].adaptive
        return Options.unchecked(
            scenario=self.scenario, method=method, step=None if adaptive else self.step,
            t_start=self.t_start, t_end=self.t_start + MOST_LIVE_STEPS * self.step, frames=3,
            forces=self.forces, estimate=False,
        )  # fmt: skip


def methods_of(mech: Mechanism, setup: Setup) -> tuple[str, ...]:
    """Return the methods available to a figure of this scene."""
    plan = plan_of(mech, setup.options("auto"), None, *(setup.state or (None, None)))
    plan = plan.touching
    return TOUCHING if plan.contacts is not None or plan.contact_points else SMOOTH


class LiveRun:
    """The memory for a run at its start, before the state is projected onto the constraints."""

    def __init__(self, mech: Mechanism, setup: Setup, method: str):
        """Build the image. Raises InputError if the scene cannot be exported."""
        q, v = setup.state or (None, None)
        plan = with_contacts(plan_of(mech, setup.options(method), None, q, v))
        if plan.changes or plan.conditions:
            text = "switches constraints on the way, which a live figure cannot do; choose another "
            text += "scenario, or export the recording without --live"
            raise InputError(Problem("export", "scenario", text))
        if plan.method.name not in (*SMOOTH, *TOUCHING):
            text = f"must be one of {choices((*SMOOTH, *TOUCHING))}, got {plan.method.name!r}"
            raise InputError(Problem("export", "method", text))
        drives = plan.drives._replace(knots=plan.drives.knots.copy())
        self.mech, self.plan = mech, replace(plan, drives=drives)
        state = with_state(mech, plan.start, q, v, float(plan.times[0]))
        self.record = Recording(mech, self.plan, *state, plan.tau)
        if mech.model.stateful:
            begin = self.record.steps.q, self.record.steps.v
            self.record.scene.begin_controls(self.record.start, 0.0, *begin)
            self.record.scene.loads.signals[0][1::2] = 0.0  # values on the way, of no later use
        if plan.tolerance is None:
            self.record.steps.open_ended(setup.step)
        self._lay_out()

    def _lay_out(self) -> None:
        scene, steps = self.record.scene, self.record.steps
        packed = scene.packed
        kept = scene._kept
        # one spring more than the scene has, for the mouse: the struct does not count it
        springs, *others = kept.loads.spring
        own = len(springs)
        self._pull = table(spring.ROW, own + 1)
        self._pull[:own] = springs
        kept = kept._replace(loads=kept.loads._replace(spring=(self._pull[:own], *others)))
        roots = {"scene": Root(SCENE, kept), "run": Root(RUN, steps._kept)}
        if scene.touching is not None:
            roots["contacts"] = Root(CONTACTS, scene.touching._kept)
        user: Any = scene.user
        if user is not None:
            from ..engine.gait.tables import WALK

            inside = user.exchange
            roots["walk"] = Root(WALK, user.kept, inside, inside[:3].nbytes)
        nb, nv = packed.nb, packed.nv
        self.position, self.rotation = np.zeros((nb, 3)), np.zeros((nb, 9))
        self.still, self.trial = np.zeros(nv), np.zeros(packed.nq + nv)
        self.view_work = np.zeros_like(scene.work)  # apart from the steps' own
        self.numbers, self.packed_arrays = packed.numbers, packed._arrays
        scratch = (self.position, self.rotation, self.still, self.trial, self.view_work)
        others = (self._pull, *self.numbers, *self.packed_arrays, *scratch)
        self.image = Image(BASE, roots, others)
        self._scene = kept

    def memory(self) -> bytearray:
        """Return the image. Kernel addresses are zero and are filled in through `links`."""
        at_, steps = self.image.at, self.record.steps
        kept = self._scene._replace(links=NO_LINKS._replace(contacts=at_.get("contacts", 0)))
        kept = kept._replace(user=kept.user._replace(address=0))
        run = steps._kept._replace(scene=at_["scene"], links=NO_RUN_LINKS)
        found = self.image.bytes({"scene": kept, "run": run})
        for name in ("address", "approach"):
            start = self._control + CONTROL[name] - BASE
            found[start : start + 8] = bytes(8)
        return found

    @property
    def _control(self) -> int:
        return self.image.place(self.record.steps.control_table)

    def links(self) -> list[tuple[int, str]]:
        """Return (address, kernel name) pairs. The address gets the kernel's index in the table."""
        scene, run, found = self.image.at["scene"], self.image.at["run"], list[tuple[int, str]]()
        names = _kernels(self.plan.method.name)
        for kind, start, value in (
            (SCENE, scene, self.record.scene._kept.links),
            (RUN, run, self.record.steps._kept.links),
        ):
            for field, address in value._asdict().items():
                if address and field != "contacts":
                    found.append((start + offset_of(kind, "links", field), names[address]))
        user = self.record.scene.user
        if user is not None:
            found.append((scene + offset_of(SCENE, "user", "address"), names[user.address]))
        if approach := int(self.record.steps.guard["approach"]):
            field = CONTROL["approach"]
            found.append((self._control + field, names[approach]))
        return found

    def lengths(self) -> list[int]:
        """Return the addresses that contain the length of the mechanism."""
        found = [self._control + CONTROL["length"]]
        if (touching := self.record.scene.touching) is not None:
            tally = touching._kept.tally
            found.append(self.image.place(tally) + tally.dtype.fields["length"][1])
        return found

    def header(self) -> dict[str, Any]:
        """Return the addresses [bytes] of all data that the browser reads and writes."""
        place, record = self.image.place, self.record
        steps, kept = record.steps, record.steps._kept
        parent, body, motions, start, tracks = self.numbers
        rows, const, bodies_i, bodies_f, home = self.packed_arrays
        copies = []
        if place(self._scene.const) != place(const):
            copies.append((place(const), place(self._scene.const), const.nbytes))
        arrays = {
            "rows": rows, "const": const, "bodies_i": bodies_i, "bodies_f": bodies_f,
            "home": home, "parent": parent, "body": body, "motion": motions, "start": start,
            "tracks": tracks,
            "view_work": self.view_work, "position": self.position, "rotation": self.rotation,
            "still": self.still, "trial": self.trial, "q": steps.q, "v": steps.v,
            "given": self._scene.given, "flow": kept.flow, "vdot": record.out.vdot[0],
            "wrenches": record.out.wrenches[0], "times": kept.times, "substeps": kept.substeps,
            "width": kept.width, "pull": self._pull[-1:], "corners": kept.corners,
            "q_shown": record.out.q[1], "v_shown": record.out.v[1],
        }  # fmt: skip
        described = {name: (place(a), *a.shape) for name, a in arrays.items()}
        touching, chosen = record.scene.touching, self.plan.tolerance is not None
        user: Any = record.scene.user
        return {
            "base": BASE,
            "size": self.image.size,
            "scene": self.image.at["scene"],
            "run": self.image.at["run"],
            "loads": self.image.at["scene"] + LOADS,
            "corners": self.image.at["run"] + CORNERS,
            "widths": {"chosen": CHOSEN, "given": GIVEN} if chosen else None,
            "control": self._control,
            "fields": CONTROL,
            "spring": offsets(spring.ROW),
            "links": self.links(),
            "arrays": described,
            "copies": copies,
            "lengths": self.lengths(),
            "columns": {"mass": at.MASS, "link": at.LINK, "com": at.COM, "inertia": at.INERTIA},
            "own_loads": len(self._pull) - 1,
            "project": bool(self.plan.project and len(self.plan.active)),
            "bounded": bool(steps.guard["approach"]),
            "state": at.Y,
            "fallen": place(user.fallen) if user is not None else 0,
            "logged": _logged(self.image, touching),
        }  # fmt: skip


def _logged(image: Image, touching: Any) -> int:
    """Return the address of the number of logged phase changes, or 0 without contacts."""
    if touching is None:
        return 0
    tally = touching._kept.tally
    return image.place(tally) + tally.dtype.fields["logged"][1]


def _kernels(method: str) -> Mapping[int, str]:
    """Return {address: name} of the compiled kernels that runs call by address."""
    names = [motion.acceleration, motion.projection, motion.record, motion.constrain]
    names += [METHODS[method].kernel, crossings.cross]
    if METHODS[method].time_stepping:
        from ..engine.contact import approach, contacts
        from ..engine.gait import walking

        names += [contacts.find, contacts.contact_forces, contacts.record_contacts]
        names += [contacts.settle_contacts, approach.bound_step, walking.walking]
    called = lambda kernel: getattr(kernel, "is_ready", True)  # noqa: E731
    return {address_of(kernel): kernel.__name__ for kernel in names if called(kernel)}

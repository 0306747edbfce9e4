"""What takes a run on: steps of given width, or steps chosen by their error."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from ..contact.sites import Site
from ..contact.tables import Tables
from ..integrators import Method
from ..kernels import adaptive, implicit, motion, run
from ..kernels import layout as at
from ..kernels.handle import address_of
from ..mechanism import Mechanism
from ..system import Array, Drives, Ints, Loads
from .switching import Change, ever

NO_MATRICES = (np.zeros((0, 0)), np.zeros((0, 0), dtype=np.complex128))
NO_TIMES = np.zeros(0)
PART = 0.25  # of a step that could not be solved: what is tried first
AT_END = 1e-6  # of a step: a corner this near its end is there
FIXED_RTOL = 1e-9  # what implicit methods solve their equations to where steps are given


class Tolerance(NamedTuple):
    """How steps are chosen."""

    rtol: float  # against the mechanism's own scales
    atol: float  # of every coordinate, in its unit
    widest: float  # largest step [s]
    most: int  # steps
    corners: Array  # (nk,) times where tables bend: steps end there [s]
    fixed: bool = False  # every step is the widest


class Plan(NamedTuple):
    """What a run is made of, checked and complete."""

    method: Method
    times: Array  # (frames,) [s]
    substeps: Ints  # (frames - 1,) steps between two frames, where they are given
    width: Array  # (frames - 1,) their width [s]
    drives: Drives
    loads: Loads
    active: Ints  # indices of the active constraints
    contacts: Tables | None  # what touches; None: nothing
    gains: Array  # (2,) of Baumgarte
    project: bool
    tolerance: Tolerance | None  # None: steps are given
    sites: tuple[Site, ...] = ()  # contact points and limits of an event-driven run
    changes: tuple[Change, ...] = ()  # constraints that go on and off
    kinks: Array = NO_TIMES  # corners of tables inside steps of given width [s]

    @property
    def ever(self) -> Ints:
        """Indices of the constraints that are active at some time."""
        return ever(self.active, self.changes)


class Stepping(Protocol):
    """The state of a run, and what takes it on."""

    q: Array
    v: Array
    times: Array  # of frames; where a run fails, its last frame gets another time
    cursor: Ints
    counters: Ints
    failure: Array  # (2,) time and row, where it failed
    ledger: Array  # (2,) work and dissipation so far [J]
    stop: int  # frames until which it goes on

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` steps and frames on; the kernel's status code."""
        ...

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        ...

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        ...

    def notices(self) -> list[str]:
        """What a person should know of the steps taken."""
        ...


def stepping(mech: Mechanism, plan: Plan, q: Array, v: Array) -> Stepping:
    """What the plan's method needs."""
    return (GivenSteps if plan.tolerance is None else ChosenSteps)(mech, plan, q, v)


class GivenSteps:
    """Steps of given width between frames."""

    def __init__(self, mech: Mechanism, plan: Plan, q: Array, v: Array):
        """Nothing is computed yet."""
        self.plan = plan
        self.q, self.v, self.times = q.copy(), v.copy(), plan.times.copy()
        self.stop = len(plan.times)
        self.stages = np.zeros((5 + 2 * plan.method.evaluations, max(mech.nq, mech.nv)))
        self.flow, self.ledger, self.failure = np.zeros(3), np.zeros(2), np.zeros(2)
        self.cursor = np.zeros(2, dtype=np.int64)
        self.counters = np.zeros(at.COUNTERS, dtype=np.int64)
        self.links = _links(plan.method.step)

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` steps and frames on; the kernel's status code."""
        plan = self.plan
        return run.run(
            scene, self.links, plan.method.tableau[:3], self.schedule, self.cursor, budget,
            plan.project, self.q, self.v, self.stages, self.flow, self.ledger, self.counters,
            self.failure, out,
        )  # fmt: skip

    @property
    def schedule(self) -> tuple[Array, Ints, Array]:
        """Times, substeps and width up to where it stops."""
        last = self.stop - 1
        return self.times[: self.stop], self.plan.substeps[:last], self.plan.width[:last]

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        self.cursor[at.FRAME] -= 1
        i = int(self.cursor[at.FRAME])
        self.cursor[at.TAKEN] = self.plan.substeps[i - 1]

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        frame, taken = self.cursor.tolist()
        last = len(self.times) - 1
        part = taken / self.plan.substeps[frame - 1] if 0 < frame <= last else 0.0
        return float(min(1.0, max(0.0, frame - 1 + part) / max(last, 1)))

    def notices(self) -> list[str]:
        """Nothing: every step is as wide as asked for."""
        return []


class ChosenSteps:
    """Steps chosen by their error, frames on dense output."""

    def __init__(self, mech: Mechanism, plan: Plan, q: Array, v: Array):
        """Nothing is computed yet."""
        assert plan.tolerance is not None
        self.plan, self.tolerance = plan, plan.tolerance
        method, self.size = plan.method, (mech.nq, mech.nv)
        count = max(len(method.tableau.c), len(method.tableau.dense))
        self.stages = np.zeros((at.STAGE + count, mech.nq + mech.nv + 2))
        self.q = self.stages[at.Y, : mech.nq]
        self.v = self.stages[at.Y, mech.nq : mech.nq + mech.nv]
        self.ledger = self.stages[at.Y, mech.nq + mech.nv :]
        self.q[:], self.v[:], self.times = q, v, plan.times.copy()
        self.stop = len(plan.times)
        self.flow, self.failure = np.zeros(3), np.zeros(2)
        self.cursor = np.zeros(2, dtype=np.int64)
        self.counters = np.zeros(at.COUNTERS, dtype=np.int64)
        self.flags = np.zeros(at.FLAGS, dtype=np.int64)
        self.control = self._control(mech)
        self.flags[at.MOST], self.flags[at.FIXED] = self.tolerance.most, self.tolerance.fixed
        self.matrices = matrices(mech.nv) if method.implicit else NO_MATRICES
        self.events = no_events()
        self.parted = 0  # steps of given width that were taken in parts
        self.links = _links(method.attempt)

    def _control(self, mech: Mechanism) -> Array:
        control, given = np.zeros(at.CONTROL), self.tolerance
        control[at.RTOL], control[at.ATOL] = given.rtol, given.atol
        control[at.WIDEST], control[at.SPAN] = given.widest, float(np.ptp(self.times))
        control[at.TIME] = self.times[0]
        control[at.LENGTH], control[at.LAST_ERROR] = length_of(mech), 1e-4
        control[at.JACOBIAN_RATE], control[at.JACOBIAN_AT] = np.inf, np.nan
        control[at.WIDTH] = given.widest if given.fixed else 0.0
        return control

    def advance(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        """At most `budget` attempts and frames on; the kernel's status code."""
        code = self._attempts(scene, budget, out)
        if code == at.NOT_SOLVED and self.tolerance.fixed:
            return self._in_parts(scene, out)
        return code

    def _in_parts(self, scene: int, out: tuple[Array, ...]) -> int:
        """A step of given width that could not be solved, in steps of the method's own choice."""
        self._take_back()
        self.parted += 1
        end = self.control[at.TIME] + self.tolerance.widest * (1 - 1e-9)
        self.flags[at.FIXED], self.control[at.WIDTH] = 0, PART * self.tolerance.widest
        code = at.RUNNING
        while code == at.RUNNING and self.control[at.TIME] < end:
            code = self._attempts(scene, 1, out)
        self.flags[at.FIXED] = 1
        return code

    def _take_back(self) -> None:
        """The frame of a failure is none."""
        moved = np.flatnonzero(self.times != self.plan.times)
        if len(moved):
            self.cursor[at.FRAME] = moved[0]
            self.times[moved] = self.plan.times[moved]

    def notices(self) -> list[str]:
        """How many steps were taken in parts."""
        if self.parted == 0:
            return []
        of = "1 step" if self.parted == 1 else f"{self.parted} steps"
        return [
            f"the equations of {of} of {self.tolerance.widest:.4g} s could not be solved at once, "
            "as where friction sets in: narrower ones were taken there"
        ]

    def _attempts(self, scene: int, budget: int, out: tuple[Array, ...]) -> int:
        plan = self.plan
        return adaptive.run_adaptive(
            scene, self.links, tuple(plan.method.tableau), plan.method.controller,
            plan.method.order, self.size, self.times[: self.stop], self.tolerance.corners,
            self.cursor, budget, plan.project, self.stages,
            (self.control, self.flags, self.counters), self.matrices, self.flow, self.failure,
            self.events, out,
        )  # fmt: skip

    def restart(self) -> None:
        """Go on from a state, or with equations, that have just changed; the last frame anew."""
        self.cursor[at.FRAME] -= 1
        self.flags[at.FRESH] = self.flags[at.FILLED] = 0
        self.control[at.JACOBIAN_RATE] = 2.0

    def fraction(self) -> float:
        """How much of the run is done, 0 to 1."""
        return float(min(1.0, (self.control[at.TIME] - self.times[0]) / self.control[at.SPAN]))


def no_events() -> tuple[int, int, Array, Ints, Ints, Ints]:
    """Events of a run that looks for none, as kernels take them."""
    none = np.zeros(0, dtype=np.int64)
    return 0, 0, np.zeros(0), none, none, np.zeros(1, dtype=np.int64)


def _links(step: object) -> tuple[int, ...]:
    return tuple(
        address_of(kernel)
        for kernel in (motion.acceleration, motion.projection, motion.record, step)
    )


def matrices(nv: int) -> tuple[Array, Any]:
    """Workspace of implicit methods."""
    real = np.zeros((3 * nv + implicit.ROWS, max(2 * nv, implicit.LEAST)))
    return real, np.zeros((nv + 2, max(2 * nv, 1)), dtype=np.complex128)


def length_of(mech: Mechanism) -> float:
    """Largest of the mechanism's own lengths: links, centres of mass, radii of gyration [m]."""
    const = mech.system.const[1:]
    mass = np.where(const[:, at.MASS] > 0, const[:, at.MASS], np.inf)
    gyration = const[:, at.INERTIA : at.INERTIA + 3].sum(axis=1) / mass
    found = [np.sqrt(gyration.max(initial=0.0))]
    for column in (at.LINK, at.COM):
        found.append(np.linalg.norm(const[:, column : column + 3], axis=1).max(initial=0.0))
    return float(max(found))


def corners(
    mech: Mechanism, drives: Drives, loads: Loads, active: Ints, t_start: float, t_end: float
) -> Array:
    """Times within the run at which a table of forces or of a followed motion bends [s]."""
    found = [drives[1][:, 0], loads[2][:, 0]]
    blocks = mech.blocks
    for i in active.tolist():
        for block in range(blocks.first[i], blocks.first[i + 1]):
            first, count = blocks.blocks_i[block, [at.B_CURVE, at.B_KNOTS]].tolist()
            if count > 0:
                found.append(blocks.curves[first : first + count, 0])
    times = np.unique(np.concatenate(found))
    return times[(times > t_start) & (times < t_end)]


def corners_inside(bends: Array, times: Array, width: Array) -> Array:
    """The corners that lie inside steps of given width, and not at their ends."""
    interval = np.searchsorted(times, bends, side="right") - 1
    among = (interval >= 0) & (interval < len(width))
    bends, interval = bends[among], interval[among]
    share = (bends - times[interval]) / width[interval]
    return bends[np.abs(share - np.round(share)) > AT_END]


def onto_corners(plan: Plan) -> Plan:
    """The same run at steps of given width that end at corners of tables too."""
    times = np.union1d(plan.times, plan.kinks)
    apart = np.diff(times)
    usual = plan.width[np.searchsorted(plan.times, times[:-1], side="right") - 1]
    substeps = np.maximum(np.ceil(apart / usual - 1e-9), 1).astype(np.int64)
    return plan._replace(times=times, substeps=substeps, width=apart / substeps)

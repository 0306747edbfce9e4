"""The error of a run, from coarser runs of the same motion.

The error of a method of order p at steps h is C h^p where it is small ([Hairer, Norsett, Wanner
1993, II.4]): two runs tell C, a third one whether the law holds. Where it does not, the smaller
divisor that was seen is taken; where runs have parted altogether, the error is not known, and
the run says so. Adding up the errors of steps would miss how unstable motion makes them grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numba.core.dispatcher import Dispatcher
from numpy.typing import NDArray

from ..dynamics.states import differences
from ..engine import layout as at
from ..engine.records import ACCEPTANCE, SLIP, SWING
from ..integrators import DOPRI5, Method
from ..packing import Array, Drives, Loads
from ..result import Status
from .grazing import undecided
from .options import LEAST_RTOL, Tolerance
from .plan import FAST, NO_SUBSTEPS, NO_TIMES, STIFF, RunPlan, fastest_rate
from .recording import Estimate, Recording

Forces = TypeVar("Forces", Drives, Loads)
LOOSER = 32.0  # ratio of the tolerances of two runs
COMPARED = 65  # frames at most, where frames cost time of their own
FRAMES = 2001  # at most, where steps end at them
SETTLED = 0.5  # of the largest difference: what is left of it at the next time in a transient
EARLY = 4  # coarser steps: they do not resolve what happens within
PARTED = 0.3  # rad, or of the motion's length: beyond it, errors no longer add up
FAR = 3.0  # of that: chance makes such differences in chaotic motion
CLOSER = 1.25  # factor between the ratio that is seen there and the one that the order promises
CLOSE = 0.3  # of that: where a coarser run has parted already
TIGHT = 1e-10  # tolerance of a run that tells the error of given steps through contacts
DEAREST = 4  # times the steps of the run: what it may take
LONGEST = 8  # times the steps of the run: what one at a tighter tolerance may take
ALIKE = 1e-9  # of a step: times this near are one
FINER = 4.0  # ratio of the tolerances of two runs that can be told apart
LEAST_DIVISOR = 0.4  # of the difference: runs whose errors do not shrink at all
NARROWER = 0.7  # of the steps: a run that takes more of them is the same run
DOUBTED = 0.25  # of the ratio that the order promises
AS_PROMISED = 1.5  # factor between the ratio that is seen and the one that the order promises
AT_REST = 4.0  # of the difference: the divisor, at most, where friction ends motion in given steps
UNLIKELY = 30.0  # times it: a pair of runs so much closer than a coarser one may be so by chance
VISIBLE = 1e-3  # rad, or of the motion's length: an error that a person sees
MORE = 4  # times the steps: a coarser run that takes more blows up
FEW = 50  # steps of a coarser run: a finer one costs little then, and tells the error itself
UNEVEN = 0.1  # of the ratio that the order promises, of errors of energies
ROUNDED = 1e-13  # of the energies
VISIBLE_ENERGY = 0.01  # of the range of the kinetic one: an error that counts
BEYOND_ERROR = 30.0  # times the error, over the motion's size: an error of energies that doubts it
SHARED = 4.0  # steps a frame: of fewer, many may be those that frames ask for
CHAOTIC = 4.0  # e-folds in the second half of the time: more than powers of time make
ONE_JUMP = 0.4  # of these e-folds, between two times: what happens at once is not chaos
FITTED = 8  # points of a rate
UNSOLVED = 0.1  # of the tolerance of the equations of implicit steps
OVERDAMPED = 1.2  # times the rate without dampers, which is known to 10 %: what does not swing
RESOLVED = 0.015  # of a step: times rounded more coarsely make other steps of it
STEEP = 1e-3  # of the time: a ramp of a table that is shorter
MOST_RAMPS = 100
TWICE = 2.0  # times the gap, or the speed: the way back of an impact at full restitution
# Of a step, and times of comparison: runs so much apart do not all share an instant in a step.
SHIFTS = ((0.25, 9), (0.6, 8))
NARROW = 0.5 ** np.arange(1, 21)  # of their first step: ends of its parts
AFTER = 0.5 ** np.arange(1, 11)  # of the rest of a step after a time of comparison
ROUNDINGS = 1e3  # of times: what is nearer than so many of them is one time
SLIPS = 1e-6  # of the largest velocity: what slides
PARTS = 2  # that locating an impact makes of a step: one until it, one without length
HALF = 0.5  # of the gap that counts as closed, or of what jumps make: the usual share of it
EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)
BECAUSE = "its error is not estimated, because"
UNKNOWN = (
    f"{BECAUSE} a function gives its torques: give estimate=True to call it again for a second "
    "run, if it remembers nothing, or compare with a run at half the step, or at a tighter rtol"
)
SHORT = f"{BECAUSE} it ended before its second frame"
FAILS = f"{BECAUSE} the same run at wider or narrower steps, to compare with, fails"


class _Apart(NamedTuple):
    """How far two runs are apart at n times, the largest so far."""

    t: Array  # (n,) [s]
    each: Array  # (n,) at that time [rad, m]
    largest: Array  # (n,) [rad, m]
    share: Array  # (n,) of what is too far for errors to add up


def estimable(tau: object) -> bool:
    """Whether torques can be asked for a second time: no function, a compiled one, or a gait."""
    return not callable(tau) or hasattr(tau, "acting") or isinstance(tau, Dispatcher)


def error_estimate(record: Recording, asked: bool | None) -> Estimate:
    """The largest error of q over the recorded times, from coarser runs.

    `asked` is None where a function that gives torques is not to be called again. Where there is
    no estimate, the run's message says why.
    """
    if not record.ended.ok or asked is False:
        return Estimate()
    if asked is None and not estimable(record.tau):
        found = Estimate(why=UNKNOWN)
    elif record.ended.over:
        record.plan = _until(record.plan, float(record.steps.control["time"]))
        found = _estimated(record) if len(record.plan.times) > 1 else Estimate(why=SHORT)
    else:
        found = _estimated(record)
    if found.why:
        record.ended.message += f"; {found.why}"
    return found


def _estimated(record: Recording) -> Estimate:
    """The estimate of a run that has reached its end.

    Where runs part and frames are few, runs with more of them show when.
    """
    plan = record.plan
    if len(plan.times) < 2 or plan.times[-1] == plan.times[0]:
        return Estimate(0.0, before=0.0)  # the initial state alone
    late, step = (
        float(np.abs(plan.times).max()),
        np.ptp(plan.times) / record.steps.counters["steps"],
    )
    if EPS * late > RESOLVED * step:
        text = f"times near {late:.3g} s are rounded to {EPS * late:.1g} s, which steps of "
        return Estimate(why=f"{BECAUSE} {text}{step:.2g} s feel: start it nearer to t = 0")
    few = len(record.plan.times) < COMPARED // 2
    found = _by_coarser(record, few)
    few = few and record.steps.counters["steps"] >= COMPARED  # fewer steps have no more frames
    if few and (np.isinf(found.largest) or found.notices or _contradicted(record, found.largest)):
        shown = record.again(_with_frames(record.plan))
        found = _by_coarser(shown) if shown.ended.ok else found
    if np.isfinite(found.largest) and _turns(record):
        off = max(_shifted_apart(record, *each) for each in SHIFTS)
        found = found._replace(largest=max(found.largest, off), before=max(found.before, off))
    return found


def _turns(record: Recording) -> bool:
    """Whether something that slides under time stepping may turn or stop, at or between frames.

    Friction turns within a step, but acts through all of it: the error is this step's share, the
    same in coarser runs whose steps end alike. A slip that passes zero between two frames is at
    both of them no faster than it changes in the time between frames.
    """
    plan, pairs = record.plan, record.out.pairs[: record.done]
    still = plan.contacts is None or not plan.impulses or plan.tolerance is not None
    if still or plan.contact_points or plan.changes or plan.conditions or not pairs.size:
        return False
    touches = pairs["phase"] != SWING
    slip = np.where(touches, pairs["slip"], 0.0)
    slides = slip > SLIPS * np.abs(record.out.v[: record.done]).max(initial=0.0)
    log = record.changes
    logged = log["pair"][np.isin(log["phase"], (ACCEPTANCE, SLIP))]  # what slides between frames
    if not slides.any(axis=0)[logged].all():
        return True
    if len(pairs) < COMPARED:  # which may not show it
        return bool(slides.any())
    both = touches[1:] & touches[:-1]
    change = np.where(both, np.abs(np.diff(slip, axis=0)), 0.0).max(axis=0)
    slower = np.where(touches, slip, np.inf)
    slower = np.minimum(slower[1:], slower[:-1])
    return bool(((slides[1:] | slides[:-1]) & (slower <= change)).any())


def _shifted_apart(record: Recording, share: float, shown: int) -> float:
    """How far a run is apart, at so many times, whose steps begin this share of one later."""
    shifted, chosen = _shifted(record.plan, share, shown)
    other = record.again(shifted)
    return float(_apart(record, other, chosen).largest[-1]) if other.ended.ok else 0.0


def _shifted(plan: RunPlan, share: float, shown: int) -> tuple[RunPlan, Array]:
    """The same run, its steps a share of one later, and so many times that both record.

    Steps after its start, and after each of these times, begin narrow and double: steps of both
    runs begin there, and would otherwise share the error of a turn soon after.
    """
    h, count = float(plan.width.max()), len(plan.times)
    first = plan.times[0] + share * h
    chosen = plan.times[np.unique(np.linspace(0, count - 1, shown).astype(int))][1:]
    begin = first + h * np.floor((chosen - first) / h - ALIKE)
    narrow = [plan.times[0] + share * h * NARROW]
    narrow += [each + (start + h - each) * AFTER for each, start in zip(chosen, begin, strict=True)]
    ends = np.unique(np.concatenate((plan.times[:1], [first], begin, begin + h, *narrow)))
    ends = ends[(ends < plan.times[-1]) & (ends >= plan.times[0])]
    least = max(ALIKE * h, ROUNDINGS * EPS * float(np.abs(plan.times).max()))
    near = np.abs(ends[:, None] - chosen).min(axis=1) < least
    near[1:] |= np.diff(ends) < least
    times = np.union1d(ends[~near], chosen)
    apart = np.diff(times)
    substeps = np.maximum(np.ceil(apart / h - ALIKE), 1).astype(np.int64)
    return replace(plan, times=times, substeps=substeps, width=apart / substeps), chosen


def _by_coarser(record: Recording, few: bool = False) -> Estimate:
    """The estimate from two coarser runs; where one of DOUBTS holds, from a finer one.

    Where the first has parted and frames are `few`, runs with more of them will tell.
    """
    record.plan = plan = _effective(record.plan)
    steps = int(record.steps.counters["steps"])
    for method in _by_tolerances(record):
        if (found := _by_tolerance(record, method)) is not None:
            return found
    if _cut(plan, steps):
        return _by_finer(record, again=plan.step is None and plan.method.order <= 2)
    wider = _coarser(plan, _factor(plan))
    if wider is None:
        return _by_finer(record)
    most = MORE * steps + COMPARED  # what blows up between contacts takes ever narrower ones
    coarse = record.again(wider, most)
    if not coarse.ended.ok and any(text.startswith((FAST, STIFF)) for text in plan.told):
        return Estimate(why=FAILS)
    if not coarse.ended.ok or _frames_end(coarse):
        return _by_finer(record)
    record.ended.notices += undecided(record, coarse)
    runs = _Coarser(record, coarse)
    near = runs.near
    if few and near.share[-1] >= 1.0 and not plan.contact_points:
        before = int(np.searchsorted(near.share, 1.0)) - 1
        return _known_until(near, near.largest, max(before, 0), 0.0)
    if not _wide(coarse, record):
        erratic = _compliant(plan) or _grows(near) or near.share[-1] >= 1.0
        return _by_finer(record, runs if erratic else None)
    if any(doubted(runs) for doubted in DOUBTS):
        return _by_finer(record, runs)
    return runs.estimate


def _by_tolerances(record: Recording) -> Iterator[Method]:
    """The methods whose tight run is asked first, since the order of given steps promises nothing.

    Through soft and penalty contacts, wider steps would be the same inside them; a step that was
    divided followed a tolerance.
    """
    plan = record.plan
    if plan.tolerance is None and plan.contacts is not None and not plan.impulses:
        yield DOPRI5
    if record.steps.divided:
        yield plan.method


def _factor(plan: RunPlan) -> int:
    """How many times wider the steps of a coarser run are."""
    return 3 if plan.method.order <= 2 else 2


class _Coarser:
    """A run and coarser ones of the same motion: how far they are apart, and what that is worth.

    The second coarser run is made when it is first asked for.
    """

    def __init__(self, record: Recording, coarse: Recording):
        self.record, self.coarse, self.plan = record, coarse, record.plan
        self.near = _apart(record, coarse, coarse.plan.times)
        self.ratio = _ratio(record, coarse)
        self.chosen = not (self.plan.step or self.plan.contact_points)

    @cached_property
    def wide(self) -> Recording | None:
        """The run at the widest steps; None where no two steps are alike, or they are too few."""
        uneven = len(self.plan.contact_points) > 0
        widest = None if uneven else _coarser(self.coarse.plan, _factor(self.plan))
        return None if widest is None else self.record.again(widest)

    @cached_property
    def far(self) -> _Apart | None:
        """How far the two coarser runs are apart."""
        if self.wide is None or not _wide(self.wide, self.coarse):
            return None
        return _apart(self.coarse, self.wide, self.wide.plan.times)

    @cached_property
    def promised(self) -> float:
        """How many times farther the order promises the coarser pair to be apart; nan: nothing."""
        if self.wide is None or self.far is None:
            return np.nan
        return (_ratio(self.record, self.wide) - self.ratio) / (self.ratio - 1.0)

    @cached_property
    def held(self) -> float:
        """What the runs are apart over what the order promises."""
        if self.far is None:
            return 1.0
        seen = _seen(self.near, self.far)
        return seen / self.promised if seen == seen else float(self.near.largest[-1] == 0.0)

    @cached_property
    def errors(self) -> Array:
        """(n,) of q until the times at which the first two are compared."""
        plan, held = self.plan, self.held
        shrunk = min(held, 1.0) if plan.step else min(held, 1.0) / np.sqrt(np.clip(held, 1.0, 10.0))
        part = max((self.ratio - 1.0) * shrunk, LEAST_DIVISOR)
        if plan.step and any(np.any(body.friction) for body in self.record.mech.model.bodies):
            part = min(part, AT_REST)  # which may set in within a step, as a jump does
        return self.near.largest / part + _rounding(self.record, self.near)

    @cached_property
    def parted(self) -> int:
        """Number of the first time at which the runs have parted; how many if they have not."""
        return _parted(self.near, self.far, self.promised)

    @property
    def estimate(self) -> Estimate:
        """What the runs tell: the error at the end, or until they part."""
        if self.parted == len(self.errors):
            return Estimate(float(self.errors[-1]), before=float(self.errors[-1]))
        rate = _rate(self.record, self.near, self.parted)
        return _known_until(self.near, self.errors, max(self.parted - 1, 0), rate)


# -- doubts: whether a run at narrower steps has to tell the error -------------------------------


def _few_steps(runs: _Coarser) -> bool:
    """A coarser run has so few steps that a finer one costs little."""
    return runs.record.steps.counters["steps"] < FEW * _factor(runs.plan)


def _unresolved(runs: _Coarser) -> bool:
    """Given steps, made wider, miss a transient."""
    return bool(runs.plan.step) and _settles(runs.near, _width(runs.coarse.plan))


def _beyond_order(runs: _Coarser) -> bool:
    """The widest steps fail: they are beyond what the order holds for."""
    return runs.wide is not None and not runs.wide.ended.ok


def _unbalanced(runs: _Coarser) -> bool:
    """The errors of energies, another witness, do not grow with the step."""
    return _imbalance(runs.coarse) < UNEVEN * runs.ratio * _imbalance(runs.record)


def _by_chance(runs: _Coarser) -> bool:
    """Runs at chosen steps are so near to each other that it may be chance."""
    return runs.chosen and runs.held > UNLIKELY


def _jumped(runs: _Coarser) -> bool:
    """A function's torques may jump within steps, and the ratio is not what the order promises."""
    return _may_jump(runs.record) and _off(runs.held)


def _lawless(runs: _Coarser) -> bool:
    """Runs that stay together differ by another ratio, or grow apart as chaotic ones do.

    Where motion is chaotic, chance decides how much larger the error of a coarser run is; where
    the coarser pair has parted, it may make both alike.
    """
    near, far = runs.near, runs.far
    if runs.parted < len(near.t):
        return False
    if runs.chosen and (far is None or far.share[-1] >= 1.0 or _growth(near, runs.parted) > 0.0):
        return True
    lawless = runs.held < DOUBTED or (far is not None and far.share[-1] >= 1.0)
    return lawless and not near.share[-1] * PARTED < VISIBLE


def _parts(runs: _Coarser) -> bool:
    """The runs part, and narrower steps may do so later."""
    parts = runs.parted < len(runs.near.t)
    return parts and not runs.plan.contact_points and _can_be_finer(runs.plan)


# Asked in this order: the later ones cost more, or take the earlier ones as settled.
DOUBTS: tuple[Callable[[_Coarser], bool], ...] = (
    _few_steps, _unresolved, _beyond_order, _unbalanced, _by_chance, _jumped, _lawless, _parts,
)  # fmt: skip


# -- other runs ----------------------------------------------------------------------------------


def _by_tolerance(record: Recording, method: Method) -> Estimate | None:
    """The estimate from a run at steps that `method` chooses, tightly; None where it is too dear.

    Soft and penalty contacts bound given steps, so that wider ones would be the same inside them.
    """
    plan = record.plan
    if not method.adaptive:
        return None
    span = float(plan.times[0]), float(plan.times[-1])
    most = DEAREST * int(record.steps.counters["steps"]) + 1000
    tight = Tolerance(TIGHT, 0.0, span[1] - span[0], most, False)
    other = record.again(
        replace(plan, method=method, tolerance=tight, substeps=NO_SUBSTEPS, width=NO_TIMES)
    )
    if not other.ended.ok:
        return None
    apart = _apart(other, record, plan.times)
    errors = apart.largest + _rounding(record, apart)
    parted = int(np.searchsorted(apart.share, 1.0))
    if parted < len(errors):
        return _known_until(apart, errors, max(parted - 1, 0), _rate(record, apart, parted))
    return Estimate(float(errors[-1]), before=float(errors[-1]))


def _by_finer(
    record: Recording, coarser: _Coarser | None = None, *, again: bool = False
) -> Estimate:
    """The estimate from a run at narrower steps: dearer, and right where errors are large too.

    `again`: with one at narrower steps still, since two may agree by chance, hardly three.
    """
    plan = record.plan
    steps = int(record.steps.counters["steps"])
    finer = record.again(_narrowed(plan), LONGEST * steps + 1000)
    if finer.ended.status is Status.TOO_MANY_STEPS:
        return _by_looser(record)
    if not finer.ended.ok:
        return Estimate(why=FAILS)
    apart = _apart(finer, record, plan.times)
    ratio = _ratio(finer, record)
    if ratio <= 1.0:
        return Estimate(why=FAILS)
    held, seen, promised = 1.0, ratio, ratio
    if coarser is not None and apart.largest[-1] > 0.0 and coarser.near.share[-1] < 1.0:
        promised = (coarser.ratio - 1.0) / (1.0 - 1.0 / ratio)
        seen = float(coarser.near.largest[-1]) / float(apart.largest[-1])
        held = min(seen / promised, 1.0)
    part = max(1.0 - 1.0 / max(ratio * held, 1.0), LEAST_DIVISOR)
    errors = apart.largest / part + _rounding(record, apart)
    chance = coarser is not None and (_compliant(plan) or _grows(coarser.near))
    if chance and coarser is not None:
        # where forces set in within steps, or motion is chaotic, two runs may agree by chance
        errors *= max(1.0, coarser.near.largest[-1] / coarser.ratio / max(errors[-1], TINY))
    if coarser is not None and _may_jump(record) and _off(seen / promised):
        errors *= max(1.0, HALF * coarser.near.largest[-1] / max(errors[-1], TINY))
    beyond = coarser is not None and coarser.near.share[-1] >= 1.0  # the finer run may be off too
    parted = int(np.searchsorted(apart.share, CLOSE if beyond else 1.0))
    chosen = not (plan.step or plan.contact_points)
    again = again or (beyond and chosen and parted == len(errors))
    if again and _can_be_finer(finer.plan):
        finest = record.again(_narrowed(finer.plan), LONGEST * LONGEST * steps + 1000)
        if not finest.ended.ok:
            return Estimate(why=FAILS)
        farther = _apart(finest, record, plan.times)
        errors = np.maximum(errors, farther.largest)
        parted = int(np.searchsorted(farther.share, CLOSE if beyond else 1.0))
    if parted < len(errors):
        return _known_until(apart, errors, max(parted - 1, 0), _rate(record, apart, parted))
    largest, notices = float(errors[-1]), ()
    if held < DOUBTED and apart.share[-1] * PARTED > VISIBLE:
        text = f"the error estimate of {largest:.2g} rad or m is rough: narrower steps made the "
        made = f"{seen:.2g} times smaller" if seen > 1.0 else "no smaller"
        text += f"error {made}, where {plan.method.name} promises {promised:.3g} times"
        notices = (text,)
    return Estimate(largest, before=largest, notices=notices)


def _by_looser(record: Recording) -> Estimate:
    """All of the difference to a run at a looser tolerance: near rounding, a tighter one takes
    very many steps, and no order holds.
    """
    wider = _coarser(record.plan, 2)
    coarse = record.again(wider) if wider is not None else None
    if wider is None or coarse is None or not coarse.ended.ok:
        return Estimate(why=FAILS)
    apart = _apart(record, coarse, wider.times)
    errors = apart.largest + _rounding(record, apart)
    parted = int(np.searchsorted(apart.share, 1.0))
    if parted < len(errors):
        return _known_until(apart, errors, max(parted - 1, 0), 0.0)
    return Estimate(float(errors[-1]), before=float(errors[-1]))


# -- comparing runs ------------------------------------------------------------------------------


def _apart(one: Recording, other: Recording, times: Array) -> _Apart:
    """How far apart two runs are at times that both record."""
    a, b = (
        r.out.q[: len(times)]
        if r.plan.times is times
        else r.out.q[np.searchsorted(r.plan.times, times)]
        for r in (one, other)
    )
    rows = one.mech.packed.rows
    turned, moved = differences(rows, a, b)
    each = np.maximum(turned, moved)
    largest = np.maximum.accumulate(each)
    if not moved.any():
        return _Apart(times, each, largest, largest / PARTED)
    _, slid = differences(rows, np.broadcast_to(a[:1], a.shape), a)
    size = max(one.plan.length, float(slid.max(initial=0.0))) or 1.0
    share = np.maximum.accumulate(np.maximum(turned, moved / size)) / PARTED
    return _Apart(times, each, largest, share)


def _ratio(fine: Recording, coarse: Recording) -> float:
    """How many times larger the errors of the coarser run should be."""
    given, looser = fine.plan.tolerance, coarse.plan.tolerance
    if given is not None and looser is not None and not given.fixed:
        return looser.rtol / given.rtol
    return (_width(coarse.plan) / _width(fine.plan)) ** fine.plan.method.order


@lru_cache(maxsize=32)
def _width(plan: RunPlan) -> float:
    """Mean width of fixed steps [s]; those without dense output end at frames."""
    span = float(plan.times[-1] - plan.times[0])
    given = plan.tolerance
    if given is None:
        return span / int(plan.substeps.sum())
    if _dense(plan):
        return min(given.widest, span)
    return span / float(np.ceil(np.diff(plan.times) / given.widest - 1e-9).sum())


def _dense(plan: RunPlan) -> bool:
    """Whether frames lie within steps."""
    return len(plan.method.tableau.dense) > 0


def _compliant(plan: RunPlan) -> bool:
    """Whether soft or penalty contacts may act."""
    return plan.contacts is not None and plan.contacts.compliant


def _seen(near: _Apart, far: _Apart) -> float:
    """How many times farther the coarser pair is apart, where its errors still add up; nan where
    nothing tells.
    """
    among = np.searchsorted(near.t, far.t)
    usable = np.flatnonzero((far.share < 1.0) & (near.largest[among] > 0.0))
    if len(usable) == 0:
        return np.nan
    last = usable[-1]
    return float(far.largest[last] / near.largest[among[last]])


def _may_jump(record: Recording) -> bool:
    """Whether a function gives torques, which may jump within given steps."""
    return record.user is not None and bool(record.plan.step)


def _off(share: float) -> bool:
    """Whether runs differ in another ratio than the order promises."""
    return not 1.0 / AS_PROMISED < share < AS_PROMISED


def _settles(near: _Apart, width: float) -> bool:
    """Whether the difference is largest for so short a time that steps of this width miss it."""
    most = int(near.each.argmax())
    around = slice(max(most - 1, 0), most + 2)
    if near.t[most] - near.t[0] < EARLY * width:
        return True
    fast = float(near.each[around].min()) < SETTLED * float(near.each[most])
    return fast and bool(np.ptp(near.t[around]) < EARLY * width)


def _parted(near: _Apart, far: _Apart | None, promised: float) -> int:
    """The first time, by number, at which the runs have parted; their count if they have not.

    Large differences may still add up, as in a wheel that spins at the wrong speed: then both
    pairs of runs differ in the ratio that the order promises, all the way.
    """
    parted = int(np.searchsorted(near.share, 1.0))
    if parted == len(near.t) or far is None:
        return parted
    among = np.searchsorted(near.t, far.t)
    counted = near.share[among] > 0.1
    ratio = far.largest[counted] / near.largest[among][counted] / promised
    slack = min(3.0, np.sqrt(promised + 1.0)) if near.share[-1] < FAR else CLOSER
    if len(ratio) > 2 and np.all((ratio > 1.0 / slack) & (ratio < slack)):
        return len(near.t)
    return parted


def _rate(record: Recording, apart: _Apart, parted: int) -> float:
    """The rate at which motion that is chaotic parts [1/s]; 0 where steps are unstable."""
    rate, plan = _growth(apart, parted), record.plan
    if rate > 0.0 and plan.step and plan.method.limit:
        forces = plan.drives, plan.loads
        fastest = fastest_rate(record.mech, forces, plan.active, record.out.q[0], record.out.v[0])
        rate = rate if fastest * plan.step <= plan.method.limit else 0.0
    return rate


def _growth(apart: _Apart, parted: int) -> float:
    """The rate at which two runs part [1/s]; 0 where that is no faster than powers of time."""
    last = min(parted, len(apart.t) - 1)
    half = apart.t[0] + 0.5 * (apart.t[last] - apart.t[0])
    some = np.flatnonzero((apart.t[: last + 1] >= half) & (apart.largest[: last + 1] > 0.0))
    if len(some) < FITTED:
        return 0.0
    logs = np.log(apart.largest[some])
    rate = float(np.polyfit(apart.t[some], logs, 1)[0])
    sustained = np.diff(logs).max() < ONE_JUMP * (logs[-1] - logs[0])
    return rate if sustained and rate * (apart.t[last] - half) > CHAOTIC else 0.0


def _grows(apart: _Apart) -> bool:
    """Whether two runs part faster than powers of time, until errors no longer add up."""
    parted = int(np.searchsorted(apart.share, 1.0))
    return parted < len(apart.t) and _growth(apart, parted) > 0.0


def _imbalance(record: Recording) -> float:
    """Largest error of a run's energy ledger [J], or rounding."""
    kinetic, potential, work, lost = record.out.energies[: record.done].T
    balance = kinetic + potential - work + lost
    size = max(float(np.abs(x).max(initial=0.0)) for x in (kinetic, potential, work, lost))
    return max(float(np.abs(balance - balance[0]).max(initial=0.0)), ROUNDED * size)


def _contradicted(record: Recording, error: float) -> bool:
    """Whether a run's energies are off by far more than this error of q."""
    swing = float(np.ptp(record.out.energies[: record.done, 0]))
    off = max(VISIBLE_ENERGY, BEYOND_ERROR * error / (record.plan.length or 1.0))
    return _imbalance(record) > off * swing > 0.0


def _known_until(apart: _Apart, errors: Array, last: int, rate: float) -> Estimate:
    """The estimate of a run whose error is known up to a time, by number."""
    until, before = float(apart.t[last]), float(errors[last])
    late = np.abs(apart.t).max() / np.ptp(apart.t)
    digits = 4 + max(int(np.log10(late)), 0)  # so that they tell times of this run apart
    text = f"the error is not known beyond t = {until:.{digits}g} s"
    if rate > 0.0:
        text += f" (chaotic: errors grow e-fold every {1.0 / rate:.3g} s)"
    text += f"; until then it is about {before:.2g} rad or m"
    return Estimate(np.inf, until, before, (text,))


def _rounding(record: Recording, apart: _Apart) -> float:
    """Least error of q: of rounded positions, of rounded times at these velocities, of gaps that
    count as closed, and of implicit steps, which are solved to a tolerance of their own.

    Errors of these solutions differ between two runs, `apart`, about as much as they are.
    """
    q, v, t = record.out.q, record.out.v, record.plan.times
    late = float(np.abs(t).max())
    moved = np.abs(v).max(initial=0.0) + _kicked(record) * np.ptp(t)
    size = np.abs(q).max(initial=0.0) + late * moved
    least, given = EPS * float(size) + _closed(record), record.plan.tolerance
    if given is None or not (given.fixed and record.plan.method.implicit):
        return least
    if not record.steps.divided:  # or what is fast is resolved
        least += _damped(record, given.widest)
    unsolved = UNSOLVED * given.rtol * float(np.ptp(q, axis=0).max(initial=0.0))
    return least + min(unsolved, float(apart.largest[-1]))


def _kicked(record: Recording) -> float:
    """Sum of the changes of v' in the steep ramps of tables [1/s2, m/s2].

    Times are rounded there as everywhere, in another way at every stage: what a ramp adds to a
    velocity is wrong by that time and its change of v'.
    """
    plan = record.plan
    if record.user is not None or plan.contacts is not None or plan.contact_points:
        return 0.0
    knots = plan.corners[plan.corners < plan.times[-1]]
    if len(knots) < 2:
        return 0.0
    steep = np.flatnonzero(np.diff(knots) < STEEP * np.ptp(plan.times))[:MOST_RAMPS]
    if len(steep) == 0:
        return 0.0
    change = record.accelerations(knots[steep + 1]) - record.accelerations(knots[steep])
    return float(np.linalg.norm(np.abs(change).max(axis=1, initial=0.0)))


def _damped(record: Recording, step: float) -> float:
    """Amplitude of vibrations faster than the steps, from the energy that was lost.

    Implicit methods take them out at any width, so that coarser runs do not differ. What is fast
    because dampers slow it down does not vibrate.
    """
    plan, out, n = record.plan, record.out, record.done
    start = out.q[0], out.v[0]
    rate = fastest_rate(record.mech, (plan.drives, plan.loads), plan.active, *start)
    if rate * step <= 1.0:
        return 0.0
    undamped = _undamped(plan.drives), _undamped(plan.loads)
    free = fastest_rate(record.mech, undamped, plan.active, *start)
    if free * OVERDAMPED < rate:
        return 0.0
    kinetic, potential, work, lost = out.energies[:n].T
    balance = kinetic + potential - work + lost
    inertia = np.diag(record.mech.mass_matrix(start[0]))
    speed = np.sqrt(2.0 * np.abs(balance - balance[0]).max() / inertia[inertia > 0.0])
    return float(speed.max(initial=0.0)) / rate


def _undamped(forces: Forces) -> Forces:
    """The same drives or loads without dampers."""
    table = forces.table.copy()
    table["damping"] = 0.0
    return forces._replace(table=table)


def _closed(record: Recording) -> float:
    """Error of the instants of impacts in time stepping; 0 where none was.

    Those that are located are so to the gap that counts as closed, which the end may lie within.
    """
    plan, touching = record.plan, record.scene.touching
    tables = plan.contacts
    if tables is None or touching is None or not plan.impulses or plan.contact_points:
        return 0.0
    from ..engine.contact.closing import NEAR
    from ..engine.contact.meeting import CLOSED
    from .contact_log import Clearance

    shapes, limits = tables.geometry.shapes, tables.limit_blocks[1][:, at.SIZE]
    reach = shapes["reach"][shapes["row"] > 0]
    size = np.where(reach > 0.0, reach, record.mech.packed.length).max(initial=0.0)
    closed = max(NEAR * float(size), CLOSED * float(limits.max(initial=0.0)))
    late = _late(record, max(float(size), float(limits.max(initial=0.0))), closed)
    cuts = int(touching.tally["cuts"])
    last = record.done - 1
    swings = record.out.pairs["phase"][last] == SWING
    gaps = Clearance(record.mech, tables).gaps(record.scene, record.out.q[last:][:1], len(swings))
    arriving = swings & (gaps[0] <= closed)  # before its impact, or after it
    overdue = TWICE * float(np.abs(gaps[0][arriving]).max(initial=0.0))
    return late + max(HALF * closed if cuts else 0.0, overdue)


def _late(record: Recording, size: float, closed: float) -> float:
    """Error of impacts that are not located but found in the middle of a step, or sooner: those
    that are slow. What stays there keeps it as its gap.

    `size` is that of what touches, `closed` the gap that counts as closed.
    """
    from ..engine.contact.closing import DEPTH, HARD
    from ..engine.contact.meeting import CROWD

    plan, touching = record.plan, record.scene.touching
    assert plan.contacts is not None
    assert touching is not None
    log = record.changes[np.argsort(record.changes["pair"], kind="stable")]
    landed = (log["pair"][:-1] == log["pair"][1:]) & (log["phase"][:-1] == SWING)
    at, pair = log["time"][1:][landed], log["pair"][1:][landed]
    cuts = (
        0 if plan.contacts.limits else int(touching.tally["cuts"])
    )  # a limit's may be all of them
    slow = len(np.unique(at)) - -(-cuts // PARTS)
    if slow <= 0 or plan.tolerance is not None:
        return 0.0
    n, may = record.done, plan.contacts.candidates
    frame = np.clip(np.searchsorted(plan.times[:n], at) - 1, 0, max(n - 2, 0))
    h, after = plan.width[frame], record.out.pairs[frame + 1, pair]
    jumps = np.abs(np.diff(record.out.v[:n], axis=0)[frame]).max(axis=1)
    if len(may.on_ground) + len(may.pairs) + len(may.members) <= CROWD:  # faster ones are located
        pull = float(touching.tally["pull"])
        jumps = np.minimum(jumps, TWICE * np.maximum(HARD * pull * h, DEPTH * size / h))
    stays = after["phase"] != SWING
    sunk = np.abs(after["gap"][stays])
    slow -= int((sunk > closed).sum())
    bounces = np.sort((HALF * h * jumps)[~stays])[: max(slow, 0)]
    return float(max(sunk.max(initial=0.0), bounces.max(initial=0.0)))


# -- the runs ------------------------------------------------------------------------------------


def _until(plan: RunPlan, end: float) -> RunPlan:
    """The part of a plan before a time."""
    count = int(np.searchsorted(plan.times, end))
    return replace(
        plan, times=plan.times[:count], substeps=plan.substeps[: max(count - 1, 0)],
        width=plan.width[: max(count - 1, 0)],
        changes=tuple(change for change in plan.changes if change.t < end),
    )  # fmt: skip


def _wide(coarse: Recording, fine: Recording) -> bool:
    """Whether a run is notably coarser than another."""
    if coarse.plan.tolerance is None or coarse.plan.tolerance.fixed:
        return _width(fine.plan) < NARROWER * _width(coarse.plan)
    return coarse.steps.counters["steps"] < NARROWER * fine.steps.counters["steps"]


@lru_cache(maxsize=32)
def _effective(plan: RunPlan) -> RunPlan:
    """The same run, its fixed steps no wider than those between times that end them."""
    given = plan.tolerance
    if given is None or not given.fixed:
        return plan
    apart = np.diff(_ends(plan))
    each = np.minimum(apart, given.widest)
    if not _dense(plan):
        each = apart / np.maximum(np.ceil(apart / given.widest - 1e-9), 1.0)
    widest = float(each.max())
    return (
        plan if widest >= given.widest else replace(plan, tolerance=given._replace(widest=widest))
    )


def _cut(plan: RunPlan, steps: int) -> bool:
    """Whether frames or corners end so many steps that a coarser run would share them."""
    given = plan.tolerance
    if given is None:
        return len(plan.corners) > 0
    if given.fixed:
        return bool(np.diff(_ends(plan)).min() < NARROWER * given.widest)
    return not _dense(plan) and steps < SHARED * len(plan.times)


def _ends(plan: RunPlan) -> Array:
    """Times at which steps of the run must end."""
    bends = plan.corners
    first, last = plan.times[0], plan.times[-1]
    kept = bends[(bends > first) & (bends < last)]
    return np.union1d([first, last] if _dense(plan) else plan.times, kept)


def _frames_end(record: Recording) -> bool:
    """Whether frames end the last steps of a run that would have chosen wider ones."""
    plan, chosen = record.plan, record.plan.tolerance
    if chosen is None or chosen.fixed or _dense(plan):
        return False
    return bool(record.steps.control["width"] > plan.times[-1] - plan.times[-2])


def _can_be_finer(plan: RunPlan) -> bool:
    """Whether a tolerance can be notably tighter than the plan's."""
    given = plan.tolerance
    return given is None or given.fixed or given.rtol > FINER * LEAST_RTOL


@lru_cache(maxsize=32)
def _coarser(plan: RunPlan, factor: int) -> RunPlan | None:
    """The same run at `factor` times wider steps, or LOOSER tolerances; None for too few steps."""
    count, given = len(plan.times), plan.tolerance
    cuts = np.searchsorted(plan.times, [*(change.t for change in plan.changes)])
    if given is None:
        if int(plan.substeps.sum()) < factor:
            return None
        return _joined(plan, factor, cuts)
    few = np.linspace(0, count - 1, min(COMPARED, count)).astype(int)
    if given.fixed:
        wide = factor * given.widest
        if plan.times[-1] - plan.times[0] < wide * (1 - 1e-9):
            return None
        stride = 1 if _dense(plan) else int(np.ceil(wide / np.diff(plan.times).min() - 1e-6))
        few = np.append(np.arange(0, count - 1, max(min(stride, count - 1), 1)), count - 1)
        changed = given._replace(widest=wide)
    else:
        changed = given._replace(rtol=LOOSER * given.rtol, atol=LOOSER * given.atol)
        if given.widest < plan.times[-1] - plan.times[0]:
            changed = changed._replace(widest=factor * given.widest)
    return replace(plan, times=plan.times[np.union1d(few, cuts)], tolerance=changed)


def _joined(plan: RunPlan, factor: int, cuts: NDArray[np.intp]) -> RunPlan:
    """Fixed steps of `factor` times the width, frames at FRAMES of the plan's times at most.

    Times at `cuts` are kept. Frames are joined until they hold whole wide steps.
    """
    count = len(plan.substeps)
    group = -(-factor // int(plan.substeps.max()))
    while count // group >= FRAMES:
        group *= 2
    keep = np.union1d(np.arange(0, count, group), cuts)
    keep = keep[keep < count]
    steps = np.add.reduceat(plan.substeps, keep)
    times = plan.times[np.append(keep, count)]
    substeps = -(-steps // factor)
    return replace(plan, times=times, substeps=substeps, width=np.diff(times) / substeps)


@lru_cache(maxsize=32)
def _narrowed(plan: RunPlan) -> RunPlan:
    """The same run at half the step, or at a tighter tolerance."""
    given = plan.tolerance
    if given is None:
        return replace(
            plan, substeps=2 * plan.substeps, width=0.5 * plan.width, parts=2 * plan.parts
        )
    ends = _ends(plan)
    halves = ends[:-1] + 0.5 * np.diff(ends)  # or steps between these ends would stay the same
    if given.fixed:
        half = given._replace(widest=0.5 * given.widest)
        return replace(plan, tolerance=half, parts=2 * plan.parts)
    rtol = max(given.rtol / LOOSER, LEAST_RTOL)
    tighter = given._replace(rtol=rtol, atol=given.atol * rtol / given.rtol)
    return replace(plan, tolerance=tighter, corners=np.union1d(plan.corners, halves))


def _with_frames(plan: RunPlan) -> RunPlan:
    """The same steps with at least COMPARED frames, where there are so many steps."""
    parts = -(-(COMPARED - 1) // max(len(plan.times) - 1, 1))
    given = plan.tolerance
    if given is not None:
        if given.fixed:
            parts = max(1, min(parts, int(np.diff(plan.times).min() / given.widest * (1 + 1e-9))))
        each = np.linspace(plan.times[:-1], plan.times[1:], parts, endpoint=False, axis=1)
        return replace(plan, times=np.append(each.ravel(), plan.times[-1]))
    times, substeps = [], []
    for t, steps, width in zip(plan.times, plan.substeps, plan.width):
        firsts = np.unique(np.linspace(0, steps, min(parts, steps) + 1).astype(int))
        times.append(t + firsts[:-1] * width)
        substeps.append(np.diff(firsts))
    times, substeps = np.append(np.concatenate(times), plan.times[-1]), np.concatenate(substeps)
    return replace(plan, times=times, substeps=substeps, width=np.diff(times) / substeps)

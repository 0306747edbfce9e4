"""Derivatives of a run by numbers of its model, its initial state and its inputs.

A run of numbers decides on all steps. After each one, runs of duals repeat it from the same state,
each with seven derivatives. Packed constants that are linear in a number have the slope of their
line. Others are differentiated by central differences of order 6 over steps of 1/256 of the number,
to about 1e-12 of them. Everything after packing is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.lifted import (
    MOST,
    Differs,
    are_on_lines,
    laid_out,
    lifted,
    slope_of,
    weighted,
)
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import FACTORED, RUN_OF_DUALS, SCENE_OF_DUALS, RunLinks
from ..engine.compiler.address import address_of, address_of_array, buffer
from ..engine.compiler.dual import WIDTH
from ..engine.compiler.kinds import F1, carrying
from ..engine.records import CHOSEN, COUNTERS, STEP_CONTROL, table
from ..engine.signals import AT_MOST, CHOOSE, LESS, SAMPLE
from ..errors import InputError, ModelError, PgraphError, Problem, nearest, shown
from ..forces import OnJoint
from ..mechanism import Mechanism
from ..packing import Array, Ints
from ..packing.forces import times_at_bounds
from ..result import Result
from ..result.records import Derivatives
from ..tolerances import step_of_differences
from .options import Options
from .paths import Path, distinct
from .plan import RunPlan, varied

# weights of f(x + k h) for h f'(x), k = -3 ... 3, and on one side, k = 0 ... 6
CENTRAL = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
ONE_SIDED = {0: -49 / 20, 1: 6.0, 2: -15 / 2, 3: 20 / 3, 4: -15 / 4, 5: 6 / 5, 6: -1 / 6}
NUMBERS = carrying(F1)
SHARE = step_of_differences(6)  # step of differences over the size of a number
ROUNDS = 50  # projections of the initial state, as in `assembled`


class Given(NamedTuple):
    """The arguments of a run that its derivatives need again."""

    mech: Mechanism
    options: Options
    plan: RunPlan
    tau: Any
    q: Any
    v: Any
    recording: Callable[..., Any]  # makes a `Recording`

    def at(self, mech: Mechanism, options: Options) -> RunPlan:
        """The plan for another mechanism of the same structure."""
        return varied(mech, options, self.plan, self.tau, self.q, self.v)


@dataclass(frozen=True)
class Variable:
    """A number that a run is differentiated by."""

    path: str
    present: float
    made: Callable[[float], tuple[Mechanism, RunPlan]]  # the run for another value
    seed: tuple[int, int] | None = None  # 0 or 1, and the place in the initial q or v

    def step(self) -> float:
        """Step of the differences."""
        return SHARE * (abs(self.present) or 1.0)


def variables_of(given: Given, wrt: Any, call: str = "simulate") -> list[Variable]:
    """The numbers at these paths. Raises InputError."""
    listed = [wrt] if isinstance(wrt, str) else wrt
    if not isinstance(listed, (list, tuple)) or not listed:
        text = f"must be a list of paths, as ['bodies.arm.mass', 'q.arm']; given {shown(wrt)}"
        raise InputError(Problem(call, "wrt", text))
    found, paths = [], []
    for one in listed:
        if not isinstance(one, (str, tuple, list)) or not one:
            raise InputError(Problem(call, "wrt", f"must name paths; given {shown(one)}"))
        word = one if isinstance(one, str) else ".".join(map(str, one))
        group, _, name = word.partition(".")
        if group in ("q", "v") and word not in given.mech.model.parameters:
            found.append(_coordinate(given, group, name, call))
        elif group == "inputs" and word not in given.mech.model.parameters:
            found.append(_input(given, name, call))
        else:
            paths.append(Path(given.mech.model, one, call))
            found.append(_number(given, paths[-1]))
    distinct(paths, call)
    names = [one.path for one in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(Problem(call, "wrt", f"'{name}' is given twice"))
    return found


def _number(given: Given, path: Path) -> Variable:
    options, model = given.options, given.mech.model
    call = {"q": given.q, "v": given.v, "tau": given.tau, "inputs": dict(options.inputs) or None}
    if instead := path.replaced_by(model, options.scenario, call):
        raise InputError(Problem("simulate", path.text, f"has no influence: {instead}"))
    if np.isnan(path.present):
        text = "has no value in the model: give it one to differentiate by it"
        raise InputError(Problem("simulate", path.text, text))

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        mech = Mechanism(path.set(model, x))
        return mech, given.at(mech, options)

    return Variable(path.text, path.present, made)


def _coordinate(given: Given, kind: str, name: str, call: str) -> Variable:
    """An initial coordinate: "q.arm", or "v.trunk.3" of a joint with several."""
    mech = given.mech
    joints = {
        body: range(*getattr(joint, kind).indices(len(given.plan.start[kind == "v"])))
        for body, joint in mech.joints.items()
    }
    body, _, entry = name.rpartition(".")
    body, entry = (body, entry) if body in joints and entry.isdecimal() else (name, "0")
    if body not in joints:
        text = f"no body with a moving joint is named {body!r}; {nearest(body, joints)}"
        raise InputError(Problem(call, f"{kind}.{name}", text))
    place = joints[body]
    if (body == name and len(place) > 1) or int(entry) >= len(place):
        text = f"the joint has {len(place)} entries: name one, as in {kind}.{body}.0"
        raise InputError(Problem(call, f"{kind}.{name}", text))
    index = place[int(entry)]
    if kind == "q" and any(i <= index < i + 4 for _, i, _ in mech.packed.quaternions):
        text = "is a part of a quaternion, which does not vary alone"
        raise InputError(Problem(call, f"{kind}.{name}", text))
    start, t = given.plan.start, float(given.plan.times[0])

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        state = [part.copy() for part in start]
        state[kind == "v"][index] = x
        return mech, replace(given.plan, start=mech.packed.with_states(t, *state))

    present = float(start[kind == "v"][index])
    alone = mech.packed.run is mech.packed  # no state of a control starts from it
    seed = (int(kind == "v"), index) if alone else None
    return Variable(f"{kind}.{name}", present, made, seed)


def _input(given: Given, name: str, call: str) -> Variable:
    options = given.options
    inputs = dict(options.inputs)
    present = inputs.get(name)
    if not isinstance(present, (int, float)):
        text = f"is not a number given in the call; give inputs={{{name!r}: 0.0}} to simulate"
        raise InputError(Problem(call, f"inputs.{name}", text))

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        changed = tuple((inputs | {name: x}).items())
        return given.mech, given.at(given.mech, options._replace(inputs=changed))

    return Variable(f"inputs.{name}", float(present), made)


# -- runs of duals ---------------------------------------------------------------------------------


class Carried:
    """The derivatives of a run in progress."""

    def __init__(self, given: Given, variables: Sequence[Variable]):
        """Raises InputError for a run that has no derivatives."""
        self.given, self.variables = given, variables
        self._ended: list[str] = []
        self._base: tuple[Any, Array, Array] | None = None
        self.out = np.zeros((0, 0, 0, WIDTH))  # empty until a run starts
        _refuse(given)

    def join(self, record: Any, start: tuple[Array, Array]) -> None:
        """Carry derivatives through the steps of a recording that is at its start.

        `start` is the initial state before it was assembled. Raises InputError.
        """
        from ..engine.stepping import duals

        n = len(record.plan.times)
        slopes = [self._slope(record, variable) for variable in self.variables]
        size = -(-len(slopes) // MOST)
        self.out = np.full((size, n, record.steps.stages.shape[1], WIDTH), np.nan)
        groups = [slopes[k : k + MOST] for k in range(0, len(slopes), MOST)]
        self._runs = [_RunOfDuals(record, start, group) for group in groups]
        self._addresses = np.array([run.address for run in self._runs])
        self._step, self._note = map(address_of, (record.plan.method.of_duals, duals.note_duals))
        self._advance = address_of(_advance_run())
        self._kernel = duals.advance_with_duals
        record.steps.carried = self
        record._free = None  # nobody else steps it

    def advance(self, run: int, budget: int) -> int:
        """`advance_run`, with derivatives."""
        given = self._addresses, self._step, self._note, self.out, budget
        return self._kernel(run, self._advance, *given)

    def stop(self, record: Any, why: str) -> None:
        """Go on without derivatives."""
        t = float(record.steps.control["time"])
        record.steps.carried = None
        self._ended.append(f"at t = {t:.6g} s derivatives end: {why}")

    def notices(self) -> list[str]:
        """Sentences on where derivatives end, and on numbers without influence."""
        idle = [one.path for one, d in zip(self.variables, self._each()) if not d.any()]
        found = self._ended + [f"{path} has no influence on the motion" for path in idle]
        for one, d in zip(self.variables, self._each()):
            if not self._ended and not np.isfinite(d).all():
                found.append(f"derivatives by {one.path} are not finite: a slope was infinite")
        return found

    @cached_property
    def order(self) -> Ints:
        """The entries of the state of a run: first the motion, then the controls."""
        mech, (q, v) = self.given.mech, self.given.plan.start
        entries = np.arange(len(q) + len(v) + 2)
        own = np.isin(
            entries, [*range(mech.nq, len(q)), *range(len(q) + mech.nv, len(entries) - 2)]
        )
        last = entries >= len(entries) - 2
        return np.concatenate((entries[~own & ~last], entries[own], entries[last]))

    def _each(self) -> list[Array]:
        """The derivatives by each variable, (frames, nq + nv + 2)."""
        return [group[..., k] for group in self.out for k in range(1, WIDTH)]

    def of_frames(self, rows: slice | Ints) -> Derivatives:
        """{path: (frames, nq + nv + 2)} of q, v, work and dissipation."""
        found = {one.path: d[rows][:, self.order] for one, d in zip(self.variables, self._each())}
        return Derivatives(found, self)

    def scale_of(self, path: str) -> float:
        """Return the size of a number."""
        (variable,) = (one for one in self.variables if one.path == path)
        return abs(variable.present) or 1.0

    def beside(self, run: Result, path: str, change: float) -> Result:
        """The run that a number changed by this much has to first order, at the same frames."""
        from ..engine.stepping.duals import record_states

        (variable,) = (one for one in self.variables if one.path == path)
        mech, plan = variable.made(variable.present + change)
        plan = replace(plan, times=np.array(run.t), shown=None, changes=(), way=None)
        other = self.given.recording(mech, plan, *plan.start, self.given.tau)
        states = np.zeros((len(run.t) + 1, other.steps.stages.shape[1]))
        own = np.zeros(run.states.shape), run.states
        here = np.column_stack((run.q, run.v, *own, run.work, run.dissipation))
        states[1:, self.order] = here + change * run.derivatives[path]
        record, accelerate = address_of(motion.record), address_of(motion.acceleration)
        arrays = tuple(other.out)
        record_states(other.scene.address, record, accelerate, plan.times, states, arrays)
        other.steps.control["frame"] = len(run.t)
        return other.result(None, (), {})

    def _slope(self, record: Any, variable: Variable) -> tuple[Any, Array, Array]:
        """Derivatives of the scene and of the initial state."""
        if variable.seed is not None:
            q, v = (np.zeros(len(part)) for part in self.given.plan.start)
            (q, v)[variable.seed[0]][variable.seed[1]] = 1.0
            arrays = record.scene.arrays
            return slope_of(SCENE_OF_DUALS, [arrays], [0.0]), q, v
        h, refused = variable.step(), dict[type, PgraphError]()
        built = cache(lambda k: self._built(variable, k * h) if k else self._here(variable))
        try:
            if (slope := self._line(built, h)) is not None:
                return slope
        except (ModelError, Differs):
            pass  # at one of the ends: one side is left
        for side, weights in ((1, CENTRAL), (1, ONE_SIDED), (-1, ONE_SIDED)):
            try:
                found = [built(side * k) for k in weights]
                return self._sum(found, [side * weight / h for weight in weights.values()])
            except ModelError as error:
                refused[ModelError] = error
            except Differs:
                text = "changes what acts as it leaves its value, so that no derivative exists"
                refused[Differs] = InputError(Problem("simulate", variable.path, text))
        raise refused.get(Differs) or refused[ModelError]

    def _built(self, variable: Variable, change: float) -> tuple[Any, Array, Array]:
        """The scene and the initial state for another value."""
        mech, plan = variable.made(variable.present + change)
        other = self.given.recording(mech, plan, *plan.start, self.given.tau)
        return other.scene.arrays, *plan.start

    def _here(self, variable: Variable) -> tuple[Any, Array, Array]:
        """The scene and the initial state as they are, the same for all numbers."""
        if self._base is None:
            self._base = self._built(variable, 0.0)
        return self._base

    def _sum(self, found: Sequence[Any], weights: Sequence[float]) -> tuple[Any, Array, Array]:
        scene = slope_of(SCENE_OF_DUALS, [one[0] for one in found], weights)
        q, v = (weighted([one[i] for one in found], weights) for i in (1, 2))
        return scene, q, v

    def _line(self, built: Callable[[int], Any], h: float) -> tuple[Any, Array, Array] | None:
        """Derivatives of what is linear in a number, from three values. None if it is not."""
        found = [built(k) for k in (0, 1, -2)]
        slope = self._sum(found, (0.0, 1.0 / (3.0 * h), -1.0 / (3.0 * h)))
        values = [*zip(*found)]
        lines = are_on_lines(SCENE_OF_DUALS, values[0]) and all(
            are_on_lines(NUMBERS, x) for x in values[1:]
        )
        return slope if lines else None


def _advance_run() -> Any:
    from ..engine.stepping.run import advance_run

    return advance_run


def _refuse(given: Given) -> None:
    plan, why = given.plan, ""
    if plan.contacts is not None or plan.contact_points:
        why = "contacts and joint limits have no derivatives yet; switch them off"
    if callable(given.tau) or plan.tau is not None:
        why = "a function of torques has no derivatives: give motors or servos in its place"
    if (plan.loads.signals[2][:, SAMPLE] >= 0).any():
        why = "controls that act at samples have no derivatives yet; give them no sample time"
    if why:
        raise InputError(Problem("simulate", "wrt", why))
    if not plan.method.implicit:
        _refuse_bounded(given)
    code = plan.loads.signals[0]
    if np.isin(code[::2, 0], (CHOOSE, LESS, AT_MOST)).any():
        text = "an expression that compares has no derivatives yet, because its value jumps; "
        text += "smoothstep, min and max have them"
        raise InputError(Problem("simulate", "wrt", text))


def _refuse_bounded(given: Given) -> None:
    """Raise InputError for a drive of which steps end at a bound, for explicit methods.

    A step begins there at a kink, and its first stage takes the derivative of the side before it.
    """
    model, options, plan = given.mech.model, given.options, given.plan
    of_scenario = () if options.scenario is None else model.scenario(options.scenario).forces
    forces = (*model.forces, *of_scenario, *options.checked_forces(given.mech))
    driving = [f for f in forces if isinstance(f, OnJoint)]
    begin, end = plan.times[[0, -1]]
    for f, row in zip(driving, plan.drives.table[plan.drives.passive :]):
        met = times_at_bounds(row, plan.drives.knots)
        least, most = f.states
        if np.isfinite([least, most]).any():
            name = "state_high" if np.isfinite(most) else "state_low"
        elif ((met >= begin) & (met <= end)).any():
            name = "torque_low" if f.torque_limit is None else "torque_limit"
        else:
            continue
        text = f"bounds what acts over time, through which {plan.method.name} has no derivatives "
        text += "yet; give method='radau5' or 'gauss6', or no bound"
        raise InputError(Problem(f"force '{f.name}'", name, text))


class _RunOfDuals:
    """The scene, the stages and the control of a run with up to seven derivatives."""

    def __init__(self, record: Any, start: tuple[Array, Array], slopes: Sequence[Any]):
        from ..engine.stepping import duals

        steps = record.steps
        scene = record.scene.arrays
        constrain = address_of(duals.constrain_duals) if len(record.scene.active) > 1 else 0
        self._scene = lifted(SCENE_OF_DUALS, scene, [slope[0] for slope in slopes])
        self._scene = self._scene._replace(links=scene.links._replace(constraints=constrain))
        self._scene.space.vectors[FACTORED] = 0.0  # these factors have no derivatives
        self._at_scene = _saved(SCENE_OF_DUALS, self._scene)
        nq, nv = len(steps.q), len(steps.v)
        stages = np.zeros((*steps.stages.shape, WIDTH))
        control = table(STEP_CONTROL, 1)
        control[:] = steps.control_table
        control["fresh"] = control["filled"] = control["guard"] = 0
        control["widths"] = CHOSEN  # not used: steps are given
        project = address_of(duals.projection_of_duals) if constrain else 0
        links = RunLinks(address_of(duals.acceleration_of_duals), project, 0, 0)
        kept = steps.kept
        self._run = kept._replace(
            scene=address_of_array(self._at_scene), links=links, stages=stages,
            real=np.zeros((*kept.real.shape, WIDTH)), control=control,
            counters=table(COUNTERS, 1), flow=np.zeros((3, WIDTH)),
        )  # fmt: skip
        self._at_run = _saved(RUN_OF_DUALS, self._run)
        self.address = address_of_array(self._at_run)
        y = stages[at.Y]
        y[: nq + nv, 0] = np.concatenate(start)
        for k, (_, q, v) in enumerate(slopes, start=1):
            y[: nq + nv, k] = np.concatenate((q, v))
        if constrain and record.plan.project:
            t = float(record.plan.times[0])
            duals.place_of_duals(self.address, t, ROUNDS)
        y[: nq + nv, 0] = np.concatenate((steps.q, steps.v))


def _saved(kind: Any, value: Any) -> Any:
    """A buffer with a lifted tuple."""
    words, out = laid_out(kind, value), buffer()
    out[: len(words)] = words
    return out

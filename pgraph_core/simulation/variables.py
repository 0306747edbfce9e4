"""Parameters of derivatives of a run, and the derivatives of the scene and the initial state.

The derivatives of packed constants that are linear in a parameter are exact. Other constants are
differentiated by central differences of order 6 with steps of 1/256 of the parameter. The relative
error is about 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.lifted import Differs, Flat, are_alike, are_on_lines, flat, slope_of
from ..engine.arrays import DESCRIBED, SCENE_OF_DUALS
from ..engine.compiler.kinds import F1, carrying, group
from ..engine.signals import JUMPING, SAMPLE
from ..errors import InputError, ModelError, PgraphError, Problem, shown
from ..forces import Driven, OnJoint
from ..mechanism import Mechanism
from ..packing import Array
from ..packing.forces import times_at_bounds
from ..packing.programs import unlocated
from ..tolerances import EPS, NOTABLE, step_of_differences
from .options import Options
from .paths import Path, distinct, no_joint, with_numbers
from .plan import varied
from .recording import scene_of
from .run_plan import RunPlan

# weights of f(x + k h) for h f'(x), k = -3 ... 3, and on one side, k = 0 ... 6
CENTRAL = {-3: -1 / 60, -2: 3 / 20, -1: -3 / 4, 1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
ONE_SIDED = {0: -49 / 20, 1: 6.0, 2: -15 / 2, 3: 20 / 3, 4: -15 / 4, 5: 6 / 5, 6: -1 / 6}
KEPT_SLOPES = 32_768  # numbers in the slopes that a plan keeps
SHARE = step_of_differences(6)  # step of differences over the size of a number
# steps of differences, each a sixteenth of the last, that are tried beside idle parts and for
# states that begin in equilibrium
FINER = 3
START = group(carrying(F1), carrying(F1))


class Given(NamedTuple):
    """The arguments of a run that are required by its derivatives."""

    mech: Mechanism
    options: Options
    plan: RunPlan
    tau: Any
    q: Any
    v: Any
    wrt: Any = ()  # the argument of simulate
    kept: dict[str, Slope] | None = None  # by numbers of the model, of former runs by this plan

    def at(self, mech: Mechanism, options: Options) -> RunPlan:
        """The plan for another mechanism of the same structure."""
        return varied(mech, options, self.plan, self.tau, self.q, self.v)


@dataclass(frozen=True)
class Variable:
    """A parameter with respect to which a run is differentiated."""

    path: str
    present: float
    made: Callable[[float], tuple[Mechanism, RunPlan]]  # the run for another value
    seed: tuple[int, int] | None = None  # 0 or 1, and the place in the initial q or v
    place: Path | None = None  # path of the value in the model
    idle: float | None = None  # the value that it leaves, if its part does not act there

    def step(self) -> float:
        """Step of the differences."""
        return SHARE * (abs(self.present if self.idle is None else self.idle) or 1.0)


def variables_of(given: Given, wrt: Any, call: str = "simulate") -> list[Variable]:
    """Return the parameters with these paths. Raises InputError."""
    listed = [wrt] if isinstance(wrt, str) else wrt
    if not isinstance(listed, (list, tuple)) or not listed:
        text = f"must be a list of paths, as ['bodies.arm.mass', 'q.arm'], got {shown(wrt)}"
        raise InputError(Problem(call, "wrt", text))
    found, paths = [], []
    for one in listed:
        if not isinstance(one, (str, tuple, list)) or not one:
            raise InputError(Problem(call, "wrt", f"must name paths, got {shown(one)}"))
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
        text = "has no value in the model; set a value to differentiate with respect to it"
        raise InputError(Problem("simulate", path.text, text))

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        mech = Mechanism(path.set(model, x))
        return mech, given.at(mech, options)

    return Variable(path.text, path.present, made, place=path)


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
        word = f"{kind}.{name}".rstrip(".")
        raise InputError(Problem(call, word, no_joint(kind, body, joints)))
    place = joints[body]
    if (body == name and len(place) > 1) or int(entry) >= len(place):
        text = f"the joint has {len(place)} entries: name one, as in {kind}.{body}.0"
        raise InputError(Problem(call, f"{kind}.{name}", text))
    index = place[int(entry)]
    if kind == "q" and any(i <= index < i + 4 for _, i, _ in mech.packed.quaternions):
        text = "is a component of a quaternion and cannot vary independently"
        raise InputError(Problem(call, f"{kind}.{name}", text))
    start, t = given.plan.start, float(given.plan.times[0])
    signals = given.plan.loads.signals

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        state = [part.copy() for part in start]
        state[kind == "v"][index] = x
        return mech, replace(
            given.plan, start=mech.packed.with_states(t, state[0], state[1], signals)
        )

    present = float(start[kind == "v"][index])
    alone = mech.packed.run is mech.packed  # no state of a control starts from it
    seed = (int(kind == "v"), index) if alone else None
    return Variable(f"{kind}.{name}", present, made, seed)


def _input(given: Given, name: str, call: str) -> Variable:
    options = given.options
    inputs = dict(options.inputs)
    driven = [f for f in given.mech.model.forces if isinstance(f, Driven)]
    own = {f.name: getattr(f, f.INPUT) for f in driven}
    present = inputs.get(name, own.get(name))
    if not isinstance(present, (int, float)):
        text = f"is no number in the model or the call; give inputs={{{name!r}: 0.0}} to simulate"
        raise InputError(Problem(call, f"inputs.{name}", text))

    def made(x: float) -> tuple[Mechanism, RunPlan]:
        changed = tuple((inputs | {name: x}).items())
        return given.mech, given.at(given.mech, options.changed(inputs=changed))

    return Variable(f"inputs.{name}", float(present), made)


# -- derivatives of the scene and the start --------------------------------------------------------


class Slope(NamedTuple):
    """The derivatives of a scene with its contacts, and of its initial state, by `Flat.words`."""

    scene: Array
    q: Array
    v: Array


class Differences(NamedTuple):
    """The derivatives of the words of a scene and an initial state, and whether they are linear."""

    slope: Array
    straight: bool


class Wanted(list[Any]):
    """Paths of `wrt` for several runs that differ in their numbers, and what these runs share."""

    lines: Lines | None = None


class Lines(NamedTuple):
    """Words of a scene and a start that are linear in all numbers, and in no product of them."""

    here: Flat
    values: Array  # (k,)
    slopes: Array  # (k, words)

    def hold(self, there: Flat, values: Array) -> bool:
        """Check that the words of another scene, with other values, are on the same lines."""
        if there.fixed != self.here.fixed:
            return False
        ways = self.here.words + (values - self.values) @ self.slopes
        return are_alike(self.here._replace(words=ways), there)


class Slopes:
    """Derivatives of the scene and of the initial state of a run.

    An element may be packed as inactive for some values of a parameter, such as a friction of 0 or
    a gear of 1. In this case, the derivatives are computed at a neighbouring value for which the
    element is active.
    """

    beside: Given | None = None  # the neighbouring run, if required

    def __init__(self, given: Given):
        self._take(given)

    def _take(self, given: Given) -> None:
        self._given, (q, v) = given, given.plan.start
        self._end = -len(q) - len(v)  # end of the words of a scene
        self._nv = len(v)
        self._here = cache(lambda: self._flat(given.mech, given.plan))  # the same for all numbers

    def by(self, variables: Sequence[Variable]) -> list[Slope]:
        """Compute the derivatives by each number. Raises InputError and ModelError.

        Parameters that affect different words are varied simultaneously. One scene per parameter
        and one for all of them are required to detect linear words.
        """
        shared, values = self._given.wrt, np.array([one.present for one in variables])
        asked = isinstance(shared, Wanted) and all(one.place for one in variables)
        if asked and shared.lines is not None and shared.lines.hold(self._here(), values):
            return [self._parts(slope) for slope in shared.lines.slopes]
        kept = {} if self._given.kept is None else self._given.kept
        found = {n: kept[x.path] for n, x in enumerate(variables) if x.place and x.path in kept}
        groups, ends = list[dict[int, Any]](), dict[int, Flat]()
        idle = list[Variable]()
        for n, one in enumerate(variables):
            if one.place is None or n in found:
                continue
            try:
                ends[n] = self._flat(*one.made(one.present + one.step()))
            except ModelError:
                continue
            if ends[n].fixed == self._here().fixed:
                changed = ends[n].words != self._here().words
                apart = (g for g in groups if not any((x & changed).any() for x in g.values()))
                group = next(apart, None)
                if group is None:
                    groups.append(group := {})
                group[n] = changed
            else:
                idle.append(one)
        if idle and self.beside is None:
            self.beside = self._beside(idle)
            self._take(self.beside)
            again = variables_of(self.beside, self.beside.wrt)
            pairs = zip(variables, again)
            return self.by([replace(b, idle=a.present) if a in idle else b for a, b in pairs])
        linear = dict[int, Array]()
        for group in groups:
            if len(group) > 1 or asked:
                linear |= self._together(variables, ends, group)
        found |= {n: self._parts(slope) for n, slope in linear.items()}
        if asked and len(linear) == len(variables):
            lines = Lines(self._here(), values, np.array([linear[n] for n in range(len(values))]))
            steps = np.array([one.step() for one in variables])
            back = self._all_at(variables, values - 2.0 * steps)
            if back is not None and lines.hold(back, values - 2.0 * steps):  # no products
                shared.lines = lines
        for n, one in enumerate(variables):
            if n not in found:
                found[n] = self.of(one, ends.get(n))
            if one.place is not None and (1 + len(kept)) * len(found[n].scene) <= KEPT_SLOPES:
                kept[one.path] = found[n]
        return [found[n] for n in range(len(variables))]

    def _beside(self, idle: Sequence[Variable]) -> Given:
        """Return the run with these parameters increased by two units of rounding. Raises
        InputError."""
        given = self._given
        values = [one.present + 2.0 * EPS * (abs(one.present) or 1.0) for one in idle]
        places = [one.place for one in idle if one.place is not None]
        mech = Mechanism(with_numbers(given.mech.model, places, values))
        plan = given.at(mech, given.options)
        start, other = plan.start, given.plan.start
        if given.plan.contacts is not None or any(len(a) != len(b) for a, b in zip(start, other)):
            raise _idle(idle[0])  # another number of states, or of laws of contact
        return given._replace(mech=mech, plan=plan, kept=None)

    def _together(
        self, variables: Sequence[Variable], ends: dict[int, Flat], group: dict[int, Any]
    ) -> dict[int, Array]:
        """Compute the derivatives of linear words, or {} if some words are nonlinear."""
        here, chosen = self._here(), [variables[n] for n in group]
        back = self._all_at(chosen, np.array([one.present - 2.0 * one.step() for one in chosen]))
        if back is None:
            return {}
        words = here.words.copy()
        for n, changed in group.items():
            words[changed] = ends[n].words[changed]
        three = [here, here._replace(words=words), back]
        if back.fixed != here.fixed or not are_on_lines(three):
            return {}
        slope = slope_of(three, (0.0, 1.0 / 3.0, -1.0 / 3.0))
        return {
            n: np.where(changed, slope / variables[n].step(), 0.0) for n, changed in group.items()
        }

    def _all_at(self, variables: Sequence[Variable], values: Array) -> Flat | None:
        """Return the words for other values of numbers of the model, None if they are invalid."""
        given, places = self._given, [one.place for one in variables if one.place is not None]
        try:
            mech = Mechanism(with_numbers(given.mech.model, places, values.tolist()))
            return self._flat(mech, given.at(mech, given.options))
        except ModelError:
            return None

    def of(self, variable: Variable, end: Flat | None = None) -> Slope:
        """Return the derivatives with respect to a parameter. The differences end at `end` if it is
        given.

        Raises InputError and ModelError.
        """
        if variable.seed is not None:
            found = np.zeros(len(self._here().words))
            kind, place = variable.seed
            found[(-self._nv if kind else self._end) + place] = 1.0
            return self._parts(found)
        found = self._by_differences(variable, h := variable.step(), end)
        settled = any(own.at_rest for _, _, own in self._given.mech.model.states)
        if found.straight or not (settled or variable.idle is not None):
            return self._parts(found.slope)
        for _ in range(FINER):  # no size says how far the numbers go on smoothly
            before, h = found.slope, h / 16.0
            found = self._by_differences(variable, h)
            size = max(1.0, float(np.abs(found.slope).max()))
            if np.abs(found.slope - before).max() <= NOTABLE * size:
                return self._parts(found.slope)
        if variable.idle is None:
            return self._parts(found.slope)
        raise _idle(variable)

    def _by_differences(self, variable: Variable, h: float, end: Flat | None = None) -> Differences:
        """Compute the derivatives of the words, using steps of h. Raises InputError and
        ModelError."""
        refused = dict[type, PgraphError]()

        @cache
        def built(k: int) -> Flat:
            if k == 1 and end is not None:
                return end
            return self._flat(*variable.made(variable.present + k * h)) if k else self._here()

        try:
            three = [built(k) for k in (0, 1, -2)]
            slope = slope_of(three, (0.0, 1.0 / 3.0, -1.0 / 3.0))
            if are_on_lines(three):
                return Differences(slope / h, True)
        except (ModelError, Differs):
            pass  # at one of the ends: one side is left
        for side, weights in ((1, CENTRAL), (1, ONE_SIDED), (-1, ONE_SIDED)):
            try:
                found = [self._here(), *(built(side * k) for k in weights)]
                scale = [0.0, *(side * weight / h for weight in weights.values())]
                return Differences(slope_of(found, scale), False)
            except ModelError as error:
                refused[ModelError] = error
            except Differs:
                refused[Differs] = _idle(variable)
        raise refused.get(Differs) or refused[ModelError]

    def _flat(self, mech: Mechanism, plan: RunPlan) -> Flat:
        scene, kinds = scene_of(mech, plan), [SCENE_OF_DUALS]
        values: list[Any] = [scene.arrays]
        if scene.touching is not None:
            kinds.append(DESCRIBED)
            values.append(scene.touching.described)
        return flat(group(*kinds, START), (*values, plan.start))

    def _parts(self, found: Array) -> Slope:
        return Slope(found[: self._end], *np.split(found[self._end :], [-self._nv]))


def _idle(variable: Variable) -> InputError:
    text = (
        "activates or deactivates an element at its present value; use a slightly different value"
    )
    return InputError(Problem("simulate", variable.path, text))


# -- runs without derivatives ----------------------------------------------------------------------


def refuse(given: Given) -> None:
    """Raise InputError for a run that has no derivatives."""
    plan, why = given.plan, ""
    if plan.contact_points:
        why = "derivatives with contacts and limits are only supported by method='moreau_jean'"
    if plan.contacts is not None and plan.contacts.turns:
        why = "derivatives are not supported for contacts with rolling or spinning friction"
    if plan.contacts is not None and plan.contacts.remembers:
        why = (
            "derivatives are not supported for contacts with the law 'penalty'; use the law 'soft'"
        )
    if plan.contacts is not None and len(plan.start[0]) > given.mech.nq:
        why = "derivatives are not supported for limits in combination with control states"
    if callable(given.tau) or plan.tau is not None:
        why = "derivatives are not supported for torque functions; use motors or servos instead"
    if (plan.loads.signals[2][:, SAMPLE] >= 0).any():
        why = "derivatives are not supported for sampled controls; remove the sample time"
    if plan.states is not None:
        why = "derivatives are not supported for given control states; set start of the controls"
    if why:
        raise InputError(Problem("simulate", "wrt", why))
    if not plan.method.implicit:
        _refuse_bounded(given)
    code = plan.loads.signals[0]
    located = plan.method.starts and not unlocated(code)
    if not located and np.isin(code[::2, 0], JUMPING).any():
        text = "derivatives of discontinuous values require that steps end at comparisons; use a "
        text += "method other than moreau_jean, and write comparisons as conditions"
        raise InputError(Problem("simulate", "wrt", text))


def _refuse_bounded(given: Given) -> None:
    """Raise InputError for explicit methods if steps end at a bound of a drive.

    Such a step starts at a kink, and its first stage uses the derivative before the kink.
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

"""A model as a file for the library: the memory of a run, and the variables that its user sees."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..analysis.assembly import assembled
from ..dynamics.states import Sensors
from ..engine.records import CHOSEN, GIVEN
from ..engine.signals import NUMBER_AT
from ..errors import InputError, Problem, choices
from ..forces import Driven
from ..forces.linear_actuator import GIVEN as GIVEN_INPUT
from ..forces.linear_actuator import LinearActuator
from ..forces.strut import PULL
from ..forces.wrench import Wrench
from ..integrators import METHODS
from ..joints import units_of
from ..live.image import EIGHT_BYTES
from ..live.opened import Opened, follows, opened
from ..live.run import BASE, SMOOTH, TOUCHING, LiveRun, Setup, methods_of
from ..mechanism import Mechanism
from ..model import Model
from ..model.expressions import drives_read
from ..model.expressions import wanted as wanted_dim
from ..model.output import OF_JOINT, OF_LOAD, Output
from ..model.settings import STEP
from ..packing.signals import inputs_of_states
from ..result.columns import coordinates
from ..signals.meaning import unit as unit_of
from ..simulation.inputs import Input, InputInKnots, Inputs
from ..simulation.kinks import corners
from ..simulation.options import RTOL
from ..tolerances import ROUNDING, SOLVED
from .library import LINKED, SOURCES, kernels_digest

TIME, INPUT, PARAMETER, STATE, OUTPUT, DERIVATIVE = range(6)  # kinds of variables, as in c/pgraph.h
READ = ("position", "rotation", "velocity", "angular_velocity", "velocimeter", "gyro",
        "accelerometer", *OF_LOAD, *OF_JOINT)  # kinds of outputs that are read  # fmt: skip
MOVED = 4096  # [bytes] to find the addresses in an image


def _names(prefix: str) -> list[str]:
    """Return the names of an enumeration in c/image.h in their order, without the prefix."""
    text = (SOURCES / "image.h").read_text(encoding="utf-8")
    (inside,) = re.findall(rf"enum \w+ \{{([^}}]*\b{prefix}COUNT\b[^}}]*)\}}", text)
    return [name.lower() for name in re.findall(rf"{prefix}(\w+)", inside)[:-1]]


class Effect(NamedTuple):
    """The number at `place` becomes start + slope × value, within its bounds."""

    place: int  # address in the image
    start: float = 0.0
    slope: float = 1.0
    low: float = -np.inf
    high: float = np.inf
    packs: bool = False  # the table of bodies is packed afterwards
    lag: float = 0.0  # [s] lag of a drive, 0 without one


class Variable(NamedTuple):
    """A number with a name that the user of a library sets or reads."""

    name: str
    kind: int
    value: float  # at the start
    unit: str = ""
    about: str = ""
    read: int = -1  # address in the image, or column of the readings
    effects: tuple[Effect, ...] = ()
    low: float = -np.inf
    high: float = np.inf
    immediate: bool = False  # an output that depends on inputs without a delay


class Wanted(NamedTuple):
    """The parts of a model that its user sees, and the way in which it is stepped."""

    inputs: tuple[str, ...] | None = None  # names, None for all
    outputs: tuple[str, ...] | None = None
    parameters: tuple[str, ...] = ()  # paths of fields, as for figures
    scenario: str | None = None
    method: str = "auto"
    step: float | None = None  # [s]
    rtol: float | None = None
    rates: bool = False  # whether derivatives of the states are variables


class NativeRun(LiveRun):
    """The memory of a run for the library, with pointers of eight bytes."""

    pointers = EIGHT_BYTES

    def _lay_out(self) -> None:
        self.sensors = Sensors(self.mech.packed, self.mech.model)
        nb, nv, nq = self.mech.nb, self.mech.nv, self.mech.nq
        frame, zeros = (1, nb, 6), np.zeros
        self.of_frame: dict[str, Any] = {
            "sensors": self.sensors.table, "gravity": self.sensors.gravity,
            "frame_q": zeros((1, nq)), "frame_v": zeros((1, nv)), "frame_vdot": zeros((1, nv)),
            "external": zeros(frame), "work": np.zeros_like(self.record.scene.work),
            "position": zeros((1, nb, 3)), "rotation": zeros((1, nb, 9)),
            "velocity": zeros(frame), "acceleration": zeros(frame), "force": zeros(frame),
            "pose": zeros((1, nb, 7)), "readings": zeros((1, max(self.sensors.width, 1))),
            "x": zeros(nq + nv), "loads": zeros(frame[1:]),
        }  # fmt: skip
        super()._lay_out()

    def others(self) -> tuple[Any, ...]:
        """Return the arrays outside structs."""
        return (*super().others(), *self.of_frame.values())


def chosen_method(mech: Mechanism, wanted: Wanted) -> tuple[str, Setup]:
    """Return the method of an export and the arguments of its run. Raises InputError."""
    model = mech.model
    given = model.scenario(wanted.scenario) if wanted.scenario is not None else None
    step = wanted.step or (given.step if given else None) or STEP
    setup = Setup(wanted.scenario, step)
    usual = methods_of(mech, setup)
    name = wanted.method
    if name == "auto":
        own = given.method if given is not None else None
        name = own if own in usual else usual[0]
        if wanted.rtol is not None and usual == SMOOTH:
            name = "dop853"
    if name not in usual:
        all_ = (*SMOOTH, *TOUCHING)
        what = "without contacts and limits" if usual == SMOOTH else "with contacts or limits"
        text = f"must be {choices(usual)} for a model {what}, got {name!r}"
        text += "" if name in all_ else "; implicit methods do not travel"
        raise InputError(Problem("export", "method", text))
    if wanted.rtol is not None and not METHODS[name].adaptive:
        text = f"does not apply to {name}, whose steps are fixed; leave it out, or choose dop853"
        raise InputError(Problem("export", "rtol", text))
    return name, setup


def unit_of_output(model: Model, one: Output) -> str:
    """Return the unit of an output, that of a joint by its motion."""
    if one.kind not in OF_JOINT:
        return one.reading.unit
    side = int(one.kind == "joint_velocity")
    units = [unit for m in model.body(one.at).sequence for unit in units_of(m)[side]]
    return units[one.coordinate] + "/s" * side


class Exported:
    """A model with its variables, ready to be written."""

    def __init__(self, model: Model, wanted: Wanted):
        """Lay out the run. Raises InputError for what cannot travel."""
        self.model, self.wanted = model, wanted
        self.mech = Mechanism(model)
        self.method, setup = chosen_method(self.mech, wanted)
        self.setup = setup = _assembled(self.mech, setup, self.method)
        make = partial(_made, setup=setup)
        self.run: NativeRun = make(self.mech, self.method)
        fields = [opened(model, one) for one in wanted.parameters]
        pushes = self._wrenches()
        found = follows(model, {self.method: self.run}, [*fields, *pushes], make, ROUNDING)
        numbers = [_parameter(field, of[self.method], model) for field, of in found]
        self.left_out: list[tuple[str, str]] = []  # outputs, with the reason
        self.by_tolerance = METHODS[self.method].adaptive and wanted.rtol is not None
        taken: set[str] = set()
        self.variables = [Variable("time", TIME, float(self.run.plan.times[0]), "s", "time")]
        for one in (
            *self._states(), *self._rates(), *self._outputs(), *self._inputs(),
            *map(_pushed, numbers[len(fields) :]), *numbers[: len(fields)],
        ):  # fmt: skip
            prefix = {INPUT: "inputs.", OUTPUT: "outputs."}.get(one.kind, "q.")
            name = one.name if one.name not in taken else prefix + one.name
            if name in taken:
                text = f"two variables would be named {name!r}; rename one of them in the model"
                raise InputError(Problem("export", "name", text))
            taken.add(name)
            self.variables.append(one._replace(name=name))

    # -- variables ---------------------------------------------------------------------------------

    def _states(self) -> list[Variable]:
        """Return the coordinates and velocities, named as the columns of a result."""
        place, found = self.run.image.place, list[Variable]()
        of_state = zip(("", "v."), ("", "/s"), ("coordinate", "velocity"),
                       coordinates(self.mech), "qv")  # fmt: skip
        for prefix, per, what, each, name in of_state:
            array = getattr(self.run.record, name)
            for i, (own, unit) in enumerate(each):
                at = place(array) + 8 * i
                about = f"{what} of the joint of {own}"
                found.append(
                    Variable(prefix + own, STATE, float(array[i]), unit + per, about, at,
                             (Effect(at),))
                )  # fmt: skip
        return found

    def _rates(self) -> list[Variable]:
        states = self._states() if self.wanted.rates else []
        return [
            Variable(f"der({one.name})", DERIVATIVE, 0.0, _per_second(one.unit),
                     f"rate of the {one.about}", i, immediate=i >= self.mech.nq)
            for i, one in enumerate(states)
        ]  # fmt: skip

    def _outputs(self) -> list[Variable]:
        known = {o.name: o for o in self.model.outputs}
        names = tuple(known) if self.wanted.outputs is None else self.wanted.outputs
        found, columns = list[Variable](), dict[str, int]()
        for name, begin, _ in self.run.sensors._spans:
            columns[name] = begin
        for name in names:
            if name not in known:
                have = f"; the model has {choices(known)}" if known else "; the model has none"
                raise InputError(Problem("export", "outputs", f"no output is named {name!r}{have}"))
            if not (why := self._unread(known[name])):
                found += self._output(known[name], columns[name])
            elif self.wanted.outputs is None:
                self.left_out.append((name, why))
            else:
                text = f"{why}; leave it out by outputs="
                raise InputError(Problem(f"output '{name}'", "kind", text))
        return found

    def _unread(self, one: Output) -> str:
        """Return the reason why an output does not travel, or ""."""
        text = f"is of the kind {one.kind}, which does not travel"
        if one.kind not in READ:
            return text
        pushed = METHODS[self.method].time_stepping or len(self.run.plan.active)
        text += " from a model with loops, contacts or limits"
        return text if one.kind in OF_LOAD and pushed else ""

    def _output(self, one: Output, column: int) -> list[Variable]:
        unit = unit_of_output(self.model, one)
        now = one.kind in ("accelerometer", *OF_LOAD)
        return [
            Variable(".".join(filter(None, (one.name, part))), OUTPUT, 0.0, unit,
                     one.reading.about, column + i, immediate=now)
            for i, part in enumerate(one.reading.parts)
        ]  # fmt: skip

    def _inputs(self) -> list[Variable]:
        plan, scene = self.run.plan, self.run.record.scene
        forces = plan.acting
        read = {name for part in (*forces, *self.model.controls) for name in drives_read(part)}
        known = Inputs(forces, scene.drives, scene.loads, read)
        rows = inputs_of_states(self.model, scene.loads.signals[2])
        known.add_of_states(forces, scene.loads.signals[0], rows)
        all_ = {f.name: f for f in forces if isinstance(f, Driven)}
        wanted = tuple(known.known) if self.wanted.inputs is None else self.wanted.inputs
        pushes = [f.name for f in self.model.forces if isinstance(f, Wrench)]
        found = list[Variable]()
        for name in wanted:
            if name in pushes:
                continue
            if name not in all_:
                have = choices((*all_, *pushes))
                have = f"; choose {have}" if have else "; the model has none"
                text = f"no motor, servo, actuator or wrench is named {name!r}{have}"
                raise InputError(Problem("export", "inputs", text))
            if name not in known.known:
                text = f"'{name}' follows its own table or expression; give it a constant input "
                raise InputError(Problem("export", "inputs", f"{text}in the model"))
            found += self._input(all_[name], known.known[name])
        return found

    def _wrenches(self) -> list[Opened]:
        """Return the entries of wrenches that are inputs, which have the form of parameters."""
        names = [f.name for f in self.model.forces if isinstance(f, Wrench)]
        paths = (
            f"forces.{name}.{field}.{i}"
            for name in self.wanted.inputs or () if name in names
            for field in ("force", "torque") for i in range(3)
        )  # fmt: skip
        return [opened(self.model, path) for path in paths]

    def _input(self, force: Any, one: Any) -> list[Variable]:
        """Return the variable of an input, or none if it cannot be set from outside."""
        place, low_high = self.run.image.place, force.inputs
        bodies = {body.name: body for body in self.model.bodies}
        dim = wanted_dim(force, force.INPUT, bodies)
        if isinstance(one, InputInKnots) and not isinstance(force, LinearActuator):
            return self._not_an_input(force, "is a law that the library does not know")
        if isinstance(one, InputInKnots):
            at, (least, most) = place(one.knots) + one.knots.strides[0] * one.knot, force.forces
            pull = Effect(at + 8 * PULL, -force.bias, -force.gain, -most, -least)
            effects = (pull, Effect(at + one.knots.strides[0] + 8 * GIVEN_INPUT))
        elif isinstance(one, Input):
            lag, integrates, *_ = one.follows
            if integrates:
                return self._not_an_input(force, "integrates its input, which does not travel")
            at = place(one.knots) + one.knots.strides[0] * one.knot + 8
            effects = (Effect(at, one.start, one.slope, lag=lag),)
        else:
            effects = (Effect(place(one.row) + 8 * NUMBER_AT),)
        unit, about = unit_of(dim) if dim else "", f"{force.INPUT} of a {force.kind}"
        return [Variable(force.name, INPUT, one.u, unit, about, -1, effects, *low_high)]

    def _not_an_input(self, force: Any, why: str) -> list[Variable]:
        """Leave an input out. Raises InputError if it was asked for."""
        if self.wanted.inputs is not None and force.name in self.wanted.inputs:
            text = f"{why}; leave it out by inputs="
            raise InputError(Problem(f"force '{force.name}'", force.INPUT, text))
        return []

    # -- the file ----------------------------------------------------------------------------------

    def content(self) -> bytes:
        """Return the file of the model for the library."""
        run = self.run
        memory, places = self._movable()
        values = len(memory)
        memory += struct.pack(f"<{len(self.variables)}d", *(x.value for x in self.variables))
        memory += bytes(-len(memory) % 64)
        file = _File(len(_names("W_")))
        header = run.header()
        number = {name: i for i, name in enumerate(LINKED)}
        links = [(place - BASE, number[name]) for place, name in run.links()]
        copies = [(a - BASE, b - BASE, size) for a, b, size in header["copies"]]
        effects, variables = list[Any](), list[Any]()
        for one in self.variables:
            read = one.read - BASE if one.kind == STATE else one.read
            variables.append(
                [one.kind, read, len(effects), len(one.effects), 0, _bits(one.low), _bits(one.high)]
            )
            effects += [self._effect(x) for x in one.effects]
        for row, one in zip(variables, self.variables):
            row[4] = file.add(one.name.encode() + b"\0")
        slides, spins = rates_of(self.mech)
        instants = self._instants()
        words = self._words(header) | {
            "kernels": _letters(kernels_digest()), "values": values, "base": BASE,
            "image": file.add(bytes(memory)), "image_bytes": len(memory),
            "relocations": file.words(places), "relocation_count": len(places),
            "links": file.words(links), "link_count": len(links),
            "lengths": file.words([x - BASE for x in run.lengths()]),
            "length_count": len(run.lengths()),
            "copies": file.words(copies), "copy_count": len(copies),
            "arrays": file.words(self._arrays()),
            "variables": file.words(variables), "variable_count": len(variables),
            "effects": file.words(effects), "effect_count": len(effects),
            "spins": file.words(spins), "spin_count": len(spins),
            "slides": file.words(slides), "slide_count": len(slides),
            "instants": file.words(list(map(_bits, instants))), "instant_count": len(instants),
        }  # fmt: skip
        return file.closed([words[name] for name in _names("W_") if name not in FIXED])

    def _instants(self) -> list[float]:
        """Return the times at which a table of a force or a motion has a corner [s]."""
        plan, loads = self.run.plan, self.run.record.scene.loads
        return corners(self.mech, plan.drives, loads, plan.active, -np.inf).tolist()

    def _movable(self) -> tuple[bytearray, list[int]]:
        """Return the memory, and the places of addresses in it: these follow a moved image."""
        here = self.run.memory()
        self.run.image.move(MOVED)
        there = self.run.memory()
        self.run.image.move(-MOVED)
        change = np.frombuffer(there, np.int64) - np.frombuffer(here, np.int64)
        places = 8 * np.flatnonzero(change)
        assert (change[change != 0] == MOVED).all(), "an address is no word"
        return bytearray(here), places.tolist()

    def _effect(self, one: Effect) -> list[int]:
        numbers = map(_bits, (one.start, one.slope, one.low, one.high))
        return [one.place - BASE, *numbers, int(one.packs), _bits(one.lag) if one.lag else 0]

    def _words(self, header: dict[str, Any]) -> dict[str, int]:
        run, control = self.run, header["control"] - BASE
        fields = ("time", "widths", "rtol", "widest", "origin", "taken", "frame", "last", "left",
                  "span", "fresh")  # fmt: skip
        found = {name: control + header["fields"][name] for name in fields}
        lags = run.plan.drives.table["lag"].any() or run.plan.drives.table["integrates"].any()
        held = self.mech.model.stateful or run.record.scene.user is not None or bool(lags)
        step = 0.0 if self.by_tolerance and self.wanted.step is None else self.setup.step
        return found | {
            "scene": header["scene"] - BASE, "run": header["run"] - BASE,
            "logged": max(header["logged"] - BASE, 0), "state_row": header["state"],
            "chosen": CHOSEN, "given": GIVEN, "adaptive": int(METHODS[self.method].adaptive),
            "by_tolerance": int(self.by_tolerance), "project": int(header["project"]),
            "bounded": int(header["bounded"]), "movable": int(not held),
            "start": _bits(float(run.plan.times[0])), "step": _bits(step),
            "tolerance": _bits(self.wanted.rtol or RTOL), "fixed_tolerance": _bits(SOLVED),
            "usual_span": _bits(self.span), "rows": len(run.packed_arrays[0]),
            **header["columns"], "moves": int(run.sensors.moves),
            "coordinates": self.mech.nq, "velocities": self.mech.nv,
            "loaded": int(run.sensors.loads),
        }  # fmt: skip

    @property
    def span(self) -> float:
        """The usual duration of a run [s]."""
        given = self.wanted.scenario
        return float(self.model.scenario(given).t_end) if given is not None else 1.0

    def _arrays(self) -> list[list[int]]:
        run, place = self.run, self.run.image.place
        rows, const, bodies_i, bodies_f, home = run.packed_arrays
        parent, body, motion, start, tracks = run.numbers
        known = {
            "parent": parent, "body": body, "motion": motion, "start": start, "tracks": tracks,
            "rows": rows, "const": const, "bodies_i": bodies_i, "bodies_f": bodies_f, "home": home,
            "q": run.record.q, "v": run.record.v, "trial": run.trial, "given": run._scene.given,
            "flow": run.record.steps._kept.flow, "vdot": run.record.out.vdot[0],
            "wrenches": run.record.out.wrenches[0], "times": run.record.steps._kept.times,
            **run.of_frame,
        }  # fmt: skip
        found = list[list[int]]()
        for name in _names("A_"):
            a = known[name]
            found.append([place(a) - BASE, a.itemsize, a.ndim, *a.shape, *[0] * (3 - a.ndim)])
        return found


def rates_of(mech: Mechanism) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return the coordinates whose rate is a velocity, and the first numbers of quaternions.

    Both are pairs of an index in q and one in v, which for a quaternion is that of the angular
    velocity.
    """
    slides, spins, i, j = list[tuple[int, int]](), list[tuple[int, int]](), 0, 0
    for name in mech.names:
        for motion in mech.model.body(name).sequence:
            of_q, of_v = map(len, units_of(motion))
            if of_q == of_v:
                slides += [(i + k, j + k) for k in range(of_q)]
            else:  # a quaternion comes last in q, and its angular velocity first in v
                slides += [(i + k, j + of_v - (of_q - 4) + k) for k in range(of_q - 4)]
                spins.append((i + of_q - 4, j))
            i, j = i + of_q, j + of_v
    return slides, spins


def _per_second(unit: str) -> str:
    """Return the unit of a rate."""
    own, slash, below = unit.partition("/")
    return f"{own}/s^2" if below == "s" else f"{unit}/s" if own != "1" else "1/s"


def _assembled(mech: Mechanism, setup: Setup, method: str) -> Setup:
    """Return the setup with an initial state that meets the constraints, as a run begins.

    The library moves a state by rounding alone. Raises InputError if they cannot be met.
    """
    run = NativeRun(mech, setup, method)
    plan, record = run.plan, run.record
    if not (plan.project and len(plan.active)):
        return setup
    q, v, found = assembled(mech, record.q, record.v, plan.active, record.scene, record.start)
    return setup._replace(state=(q[: mech.nq], v[: mech.nv])) if found.notable else setup


def _made(mech: Mechanism, method: str, setup: Setup) -> NativeRun:
    return NativeRun(mech, setup, method)


def _parameter(field: Opened, of: Any, model: Model) -> Variable:
    """Return the variable of a field, whose numbers the library computes. Raises InputError."""
    if of.listed:
        text = "cannot be a parameter: what depends on it follows no rule that the library knows"
        raise InputError(Problem("export", field.path.text, text))
    effects = [Effect(place, slope=factor) for place, factor in of.copies]
    effects += [Effect(place, slope=factor, packs=True) for place, factor in of.table]
    return Variable(field.path.text, PARAMETER, field.path.present, field.path.unit(model),
                    field.label, -1, tuple(effects), field.low, field.high)  # fmt: skip


def _pushed(one: Variable) -> Variable:
    """Return the input for an entry of a wrench. Raises InputError if it cannot change in a run."""
    if any(effect.packs for effect in one.effects):
        text = "cannot be an input, since the model is packed with it; give it as a parameter"
        raise InputError(Problem("export", one.name, text))
    _, name = one.name.split(".", 1)
    name, field, i = name.rsplit(".", 2)
    return one._replace(name=f"{name}.{field}.{'xyz'[int(i)]}", kind=INPUT, low=-np.inf,
                        high=np.inf)  # fmt: skip


# -- words -----------------------------------------------------------------------------------------

FIXED = ("magic", "form", "file_bytes")  # words that the file itself knows
FORM = 1


def _bits(x: float) -> int:
    return struct.unpack("<q", struct.pack("<d", x))[0]


def _letters(text: str) -> int:
    return struct.unpack("<q", text.encode())[0]


class _File:
    """A file of a model under construction: words, then its parts, then a hash."""

    def __init__(self, words: int):
        self._at, self._parts = 8 * words, list[bytes]()

    def add(self, part: bytes) -> int:
        """Add a part and return its place."""
        begin, padded = self._at, part + bytes(-len(part) % 8)
        self._parts.append(padded)
        self._at += len(padded)
        return begin

    def words(self, numbers: Any) -> int:
        """Add integers and return their place."""
        return self.add(np.array(numbers, dtype="<i8").tobytes())

    def closed(self, words: Sequence[int]) -> bytes:
        """Return the file with the words at its start, after those that it knows itself."""
        first = [_letters("PGRAPHM\n"), FORM, words[0], self._at + 8, *words[1:]]
        body = np.array(first, dtype="<i8").tobytes() + b"".join(self._parts)
        found = 14695981039346656037  # FNV-1a over words
        for word in np.frombuffer(body, "<u8").tolist():
            found = (found ^ word) * 1099511628211 % 2**64
        return body + struct.pack("<Q", found)

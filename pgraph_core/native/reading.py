"""FMUs of other programs as controllers of a model, stepped by fmpy."""

from __future__ import annotations

import math
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.states import Sensors, bodies_over, no_motion
from ..errors import FileError, InputError, Problem, choices, explained, needed, one_of, shown
from ..fields import is_number
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..model.output import OF_CONTACT, OF_LOAD
from ..packing import Array
from ..result.columns import coordinates
from ..tolerances import ROUNDING
from .description import BASE, exponents
from .image import unit_of_output

NUMBERS = ("Real", "Float64", "Float32")  # types of variables that can be connected
WITH_FORCES = ("accelerometer", *OF_LOAD, *OF_CONTACT)  # outputs that depend on the torques asked
TORQUES = {"rad": "N m", "m": "N"}  # unit of the force by the unit of the coordinate
LOGGED = 3  # last messages of an FMU that an error repeats


class Linked(NamedTuple):
    """A variable of an FMU that is `factor` x + `offset` if x is in SI units."""

    name: str
    number: int  # value reference
    type: str
    unit: str
    factor: float
    offset: float


class Fmu:
    """An FMU for co-simulation, made by `read_fmu`, as a controller with a state of its own.

    It is a torque function for `simulate` with `sample`, and can be called in a loop of a
    `Stepper`. It goes forward in time only: a run starts it again, and in other loops `restart`
    does. It is refused where a function has to be called again, or has to have derivatives.
    """

    def __init__(self, path: Path, start: Mapping[str, Any]):
        """Load an FMU without starting it. Raises FileError and InputError."""
        self._fmpy = needed("fmpy", "fmi")
        self.name, self._path, self._start = path.name, path, dict(start)
        self._folder = tempfile.mkdtemp(prefix="pgraph-fmu-")
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self.t: float | None = None  # time that it has reached [s], None before the start
        self._log: list[str] = []
        self._description = described = self._described(path)
        self._third = described.fmiVersion.startswith("3")
        self._variables = {v.name: v for v in described.modelVariables}
        self.inputs = self._named("input")  # names of variables that can be connected
        self.outputs = self._named("output")
        self._units = {unit.name: unit.baseUnit for unit in described.unitDefinitions}
        self._fixed = not described.coSimulation.canHandleVariableCommunicationStepSize
        self._width: float | None = None  # width of its first step [s]
        self._begun = False
        self._check_start()
        self._read = [self._linked(name, "outputs") for name in self.outputs]
        self._fmu = self._instantiated(described)
        self._bound: Bound | None = None

    # -- loading -----------------------------------------------------------------------------------

    def _described(self, path: Path) -> Any:
        """Extract the files and return the description. Raises FileError and InputError."""
        try:
            self._fmpy.extract(str(path), self._folder)
            found = self._fmpy.read_model_description(self._folder)
        except FileNotFoundError:
            raise FileError(Problem(str(path), "", "there is no such file")) from None
        except Exception as error:  # a zip file, XML or a description that is not valid
            text = f"is not an FMU that can be read: {error}"
            raise FileError(Problem(str(path), "", text)) from None
        if found.fmiVersion[0] not in "23":
            text = f"is an FMU of FMI {found.fmiVersion}; versions 2 and 3 are read"
            raise InputError(Problem(path.name, "", text))
        if found.coSimulation is None:
            text = "has no co-simulation, and model exchange is not read; export it again with "
            raise InputError(Problem(path.name, "", f"{text}co-simulation"))
        return found

    def _named(self, causality: str) -> tuple[str, ...]:
        return tuple(
            name for name, v in self._variables.items()
            if v.causality == causality and v.type in NUMBERS and not v.shape
        )  # fmt: skip

    def _instantiated(self, described: Any) -> Any:
        """Return the instance of fmpy. Raises InputError with the messages of the FMU."""
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        kind = FMU3Slave if self._third else FMU2Slave
        try:
            made = kind(
                guid=described.guid, unzipDirectory=self._folder,
                modelIdentifier=described.coSimulation.modelIdentifier,
            )  # fmt: skip
            made.instantiate(**self._logging())
        except Exception as error:
            text = f"cannot be started on this platform, {self._fmpy.platform_tuple}: {error}"
            raise InputError(Problem(self.name, "", text + self._messages())) from None
        weakref.finalize(self, _freed, made)
        return made

    def _logging(self) -> dict[str, Any]:
        """Return the arguments by which messages of the FMU are kept for errors."""
        kept = self._log

        def note(*told: Any) -> None:  # the text comes last
            kept.append(told[-1].decode("utf-8", "replace"))

        if self._third:
            return {"loggingOn": True, "logMessage": note}
        from ctypes import byref

        from fmpy import fmi2
        from fmpy.logging import addLoggerProxy

        called, usual = fmi2.fmi2CallbackFunctions(), fmi2.defaultCallbacks
        called.allocateMemory, called.freeMemory = usual.allocateMemory, usual.freeMemory
        called.logger = fmi2.fmi2CallbackLoggerTYPE(note)
        addLoggerProxy(byref(called))  # fmpy's proxy fills in the values of a format
        return {"loggingOn": True, "callbacks": called}

    def _messages(self) -> str:
        """Return the last messages of the FMU, to complete a sentence."""
        told = "; ".join(self._log[-LOGGED:])
        self._log.clear()
        return f". The FMU says: {told}" if told else ""

    def _check_start(self) -> None:
        known = [v.name for v in self._variables.values() if _can_start(v)]
        for name, value in self._start.items():
            if name not in known:
                text = f"{name!r} is no parameter, input or state with a start value in the FMU; "
                raise InputError(Problem("read_fmu", "start", text + one_of(known)))
            if not isinstance(value, (str, bool)) and not is_number(value):
                text = f"{name!r} must be a number, True, False or a text, got {shown(value)}"
                raise InputError(Problem("read_fmu", "start", text))

    def _linked(self, name: str, field: str) -> Linked:
        """Return an input or output of the FMU that can be connected. Raises InputError."""
        known = getattr(self, field)
        if name not in known:
            text = f"the FMU has no {field[:-1]} {name!r} that is one real number; {one_of(known)}"
            raise InputError(Problem("read_fmu", field, text))
        one = self._variables[name]
        unit = one.unit or getattr(one.declaredType, "unit", None) or ""
        base = self._units.get(unit)
        scale = (1.0, 0.0) if base is None else (base.factor, base.offset)
        # its number is (x - offset) / factor where x is in SI units
        return Linked(name, one.valueReference, one.type, unit, 1.0 / scale[0],
                      -scale[1] / scale[0])  # fmt: skip

    def dimension(self, one: Linked) -> Mapping[str, int] | None:
        """Return the exponents of the base units of a variable, or None if they are not known."""
        base = self._units.get(one.unit)
        if base is None:
            return None
        return {name: n for name in BASE if (n := getattr(base, name)) and name != "rad"}

    def __reduce__(self) -> Any:
        """Copies and other processes read the file again, and start at their first call."""
        bound = self._bound
        given = (None, {}, {}) if bound is None else bound.given
        return _again, (self._path, *given, self._start)

    # -- running -----------------------------------------------------------------------------------

    def restart(self) -> None:
        """Start again with the next call, at its time and with its inputs.

        Examples
        --------
            stepper.reset()
            controller.restart()
        """
        if self._begun:
            self._guarded("reset", self._fmu.reset)
        self.t, self._width, self._begun = None, None, False

    def step(self, t: float, inputs: Mapping[str, float] | None = None) -> dict[str, float]:
        """Go on to t with the inputs held that were given last, and take new ones.

        The first call starts the FMU at t with its inputs.

        Parameters
        ----------
        t : float
            The time [s], not before that of the last call.
        inputs : dict, optional
            New values of inputs of the FMU, in SI units.

        Returns
        -------
        dict
            The outputs of the FMU by name, in SI units.

        Raises
        ------
        InputError
            If a name or number is invalid, or if the FMU fails, with its messages.

        Examples
        --------
            out = controller.step(st.t, {"angle": st.q[0]})
            st.step(inputs={"drive": out["torque"]})
        """
        if not (is_number(t) and math.isfinite(t)):
            raise InputError(Problem("step", "t", f"must be a finite time [s], got {shown(t)}"))
        linked = [(self._linked(name, "inputs"), value) for name, value in (inputs or {}).items()]
        for one, value in linked:
            if not (is_number(value) and math.isfinite(value)):
                text = f"must be a finite number, got {shown(value)}"
                raise InputError(Problem("step", f"inputs[{one.name!r}]", text))
        self._to(float(t), linked)
        found: dict[str, float] = {}
        for one in self._read:
            get = getattr(self._fmu, f"get{one.type}")
            (number,) = self._guarded("outputs", get, [one.number])
            found[one.name] = (float(number) - one.offset) / one.factor
        return found

    def _to(self, t: float, linked: list[tuple[Linked, float]]) -> None:
        """Go on to t and set the inputs. Raises InputError."""
        if self.t is None:
            self._begin(t, linked)
            return
        width, near = t - self.t, ROUNDING * max(abs(t), abs(self.t))
        if width < -near:
            text = f"is at t = {self.t:.6g} s and cannot go back to {t:.6g} s; call restart()"
            raise InputError(Problem(self.name, "", text))
        if width > near:
            self._width = self._width or width
            if self._fixed and abs(width - self._width) > 4.0 * near:
                text = f"takes steps of one size, which was {self._width:.6g} s and is now "
                raise InputError(Problem(self.name, "", f"{text}{width:.6g} s"))
            ended = self._guarded("doStep", self._fmu.doStep, self.t, width)
            if self._third and ended[1]:
                text = f"asks to end the simulation at t = {t:.6g} s"
                raise InputError(Problem(self.name, "", text))
            self.t = t
        self._set(linked)

    def _begin(self, t: float, linked: list[tuple[Linked, float]]) -> None:
        from fmpy.simulation import apply_start_values

        fmu, self._begun = self._fmu, True
        self._guarded("start", apply_start_values, fmu, self._description, self._start)
        if self._third:
            self._guarded("start", fmu.enterInitializationMode, startTime=t)
        else:
            self._guarded("start", fmu.setupExperiment, startTime=t)
            self._guarded("start", fmu.enterInitializationMode)
        self._set(linked)
        self._guarded("start", fmu.exitInitializationMode)
        self.t = t

    def _set(self, linked: list[tuple[Linked, float]]) -> None:
        for one, value in linked:
            put = getattr(self._fmu, f"set{one.type}")
            self._guarded("inputs", put, [one.number], [one.factor * value + one.offset])

    def _guarded(self, what: str, call: Any, *args: Any, **named: Any) -> Any:
        """Call a function of the FMU. Raises InputError with its messages."""
        try:
            return call(*args, **named)
        except Exception as error:
            where = "before its start" if self.t is None else f"at t = {self.t:.6g} s"
            text = f"{error} ({where})"
            raise InputError(Problem(self.name, what, text + self._messages())) from None

    # -- as a torque function ----------------------------------------------------------------------

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques (nv,) at t, with the inputs measured at (q, v). Raises InputError."""
        if self._bound is None:
            text = "is not connected to a model; give read_fmu the model, inputs and outputs"
            raise InputError(Problem(self.name, "", text))
        return self._bound.torques(t, q, v)


class Bound:
    """The connections of an FMU with a model."""

    def __init__(self, fmu: Fmu, mech: Mechanism, inputs: Any, outputs: Any):
        """Check the connections. Raises InputError."""
        self.fmu, self.mech = fmu, mech
        from_, to = _mapping(inputs, "inputs"), _mapping(outputs, "outputs")
        self.given = mech.model, dict(from_), dict(to)
        self.sensors = Sensors(mech.packed, mech.model)
        positions, speeds = coordinates(mech)
        self.sources: dict[str, tuple[str, Any]] = {}  # name: (unit, where it is read)
        for prefix, per, kind, each in (("", "", 0, positions), ("v.", "/s", 1, speeds)):
            for i, (name, unit) in enumerate(each):
                self.sources[prefix + name] = unit + per, (kind, i)
        self._add_outputs()
        self.targets = {name: (TORQUES.get(unit, ""), i) for i, (name, unit) in enumerate(speeds)}
        self.inputs = [(name, self._source(name, source)) for name, source in from_]
        self.outputs = [(name, self._target(name, target)) for name, target in to]
        if not self.outputs:
            text = (
                "must connect at least one output of the FMU to a joint, as in {'torque': 'knee'}; "
            )
            text += f"it has {choices(fmu.outputs)}"
            raise InputError(Problem("read_fmu", "outputs", text))

    def _add_outputs(self) -> None:
        for (_, column, _), o in zip(self.sensors._spans, self.mech.model.outputs):
            unit = unit_of_output(self.mech.model, o)
            for i, part in enumerate(o.reading.parts):
                name = ".".join(filter(None, (o.name, part)))
                name = f"outputs.{name}" if name in self.sources else name
                place = None if o.kind in WITH_FORCES else (2, column + i)
                self.sources[name] = unit, place

    def _source(self, name: str, source: Any) -> tuple[int, int]:
        linked = self.fmu._linked(name, "inputs")
        if source not in self.sources:
            text = f"{source!r} is no coordinate, velocity or output of the model; "
            raise InputError(Problem("read_fmu", "inputs", text + one_of(self.sources)))
        unit, place = self.sources[source]
        if place is None:
            text = f"'{source}' depends on the torques that the FMU is asked for; take a position "
            raise InputError(Problem("read_fmu", "inputs", f"{text}or a velocity"))
        self._same_unit("inputs", linked, source, unit)
        return place

    def _target(self, name: str, target: Any) -> int:
        linked = self.fmu._linked(name, "outputs")
        if target not in self.targets:
            text = f"{target!r} is no joint coordinate of the model; {one_of(self.targets)}"
            raise InputError(Problem("read_fmu", "outputs", text))
        unit, i = self.targets[target]
        self._same_unit("outputs", linked, target, unit)
        return i

    def _same_unit(self, field: str, linked: Linked, what: str, unit: str) -> None:
        ours, theirs = exponents(unit) if unit else None, self.fmu.dimension(linked)
        if ours is None or theirs is None:
            return
        if {name: n for name, n in ours.items() if name != "rad"} != theirs:
            text = f"{linked.name!r} is in {linked.unit}, and '{what}' in {unit}"
            raise InputError(Problem("read_fmu", field, text))

    def torques(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques (nv,) of the FMU at t."""
        measured = any(kind == 2 for _, (kind, _) in self.inputs)
        of = (q, v, self._readings(q, v) if measured else q)
        values = {name: float(of[kind][i]) for name, (kind, i) in self.inputs}
        found, tau = self.fmu.step(t, values), np.zeros(self.mech.nv)
        for name, i in self.outputs:
            tau[i] += found[name]
        return tau

    def _readings(self, q: Array, v: Array) -> Array:
        """Return the readings (width,) of outputs of positions and velocities at (q, v)."""
        still, motion = np.zeros((1, self.mech.nv)), no_motion(1)
        states = q[None], v[None]
        if self.sensors.moves:
            external = np.zeros((1, self.mech.nb, 6))
            motion = bodies_over(self.mech.packed.system, *states, still, external)
        return self.sensors.read(*states, motion, np.empty((0, 0, 6)))[0]


def _mapping(given: Any, field: str) -> list[tuple[str, Any]]:
    if not isinstance(given, Mapping):
        text = f"must be names of the FMU and of the model, {{'u': 'knee'}}, got {shown(given)}"
        raise InputError(Problem("read_fmu", field, text))
    return [*given.items()]


def _can_start(variable: Any) -> bool:
    """Check whether the start value of a variable can be chosen."""
    if variable.variability == "constant":
        return False
    given = variable.causality in ("parameter", "input") or variable.initial in ("exact", "approx")
    return given and variable.start is not None


def _again(path: Path, model: Any, inputs: Any, outputs: Any, start: Any) -> Fmu:
    return read_fmu(path, model, inputs=inputs, outputs=outputs, start=start)


def _freed(fmu: Any) -> None:
    """Free an instance, after which its library can be unloaded."""
    try:
        fmu.freeInstance()
    except Exception:  # an instance that cannot be ended is dropped
        return


@explained
def read_fmu(
    path: str | Path,
    model: Model | Mechanism | None = None,
    *,
    inputs: Mapping[str, str] | None = None,
    outputs: Mapping[str, str] | None = None,
    start: Mapping[str, Any] | None = None,
) -> Fmu:
    """Read an FMU for co-simulation, such as a controller or a drive of another program.

    Connected to a model, it is a torque function for `simulate(tau=..., sample=...)`: at each
    sample it takes a step with the inputs of the sample before, then its inputs are measured, and
    its outputs are held as torques until the next sample. It requires fmpy, which is installed by
    `pip install 'pgraph-dynamics[fmi]'`. An FMU is a program: only read those that you trust.

    Parameters
    ----------
    path : str or path
        The file, of FMI 2 or 3.
    model : Model or Mechanism, optional
        The model to connect it to. Without one, call `step` of the result.
    inputs : dict, optional
        For inputs of the FMU, the names of coordinates, velocities and outputs of the model, as
        columns of a result: {"angle": "pole", "rate": "v.pole", "height": "tip.z"}. Other inputs
        keep their start values.
    outputs : dict, optional
        For outputs of the FMU, the names of coordinates on whose joints they act as torques or
        forces: {"force": "cart"}.
    start : dict, optional
        Start values of its parameters, inputs and states, in the units of the FMU.

    Returns
    -------
    Fmu
        The FMU, which is a function f(t, q, v) if it is connected.

    Raises
    ------
    MissingPackage
        If fmpy is not installed.
    FileError
        If the file cannot be read.
    InputError
        If the FMU has no co-simulation for this platform, or if a name or a unit does not fit.

    Examples
    --------
        controller = pg.read_fmu("pid.fmu", model, inputs={"angle": "pole"},
                                 outputs={"force": "cart"}, start={"kp": 20.0})
        run = pg.simulate(model, tau=controller, sample=0.01)
    """
    found = Fmu(Path(path), start or {})
    if model is not None:
        found._bound = Bound(found, mechanism_of(model, "read_fmu"), inputs or {}, outputs or {})
    elif inputs or outputs:
        text = "must be given with inputs and outputs, whose names it has"
        raise InputError(Problem("read_fmu", "model", text))
    return found

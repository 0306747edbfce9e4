"""Inputs and targets that stay constant in the tables of a stepper until the user sets them."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Any, NamedTuple

from ..dynamics.arguments import finite
from ..engine.signals import NUMBER_AT
from ..errors import InputError, Problem, one_of, shown
from ..forces import Driven, DrivenByKnots, OnJoint
from ..model import Force, Servo, Table
from ..packing import Array, Drives, Loads
from ..packing.forces import AT_ONCE, FOLLOWS, Follows, followed
from ..packing.signals import rows_of_loads
from .options import first_of

KNOTS = ("first_target", "targets", "first_torque", "torques")  # fields that locate inputs


class Input(NamedTuple):
    """An input u, whose knot has the value start + slope u."""

    force: OnJoint
    knots: Array
    knot: int
    start: float
    slope: float
    follows: Follows  # dynamics of the effective value

    @property
    def u(self) -> float:
        if not self.slope:
            return first_of(getattr(self.force, self.force.INPUT))
        return float((self.knots[self.knot, 1] - self.start) / self.slope)

    def put(self, u: float, t: float) -> None:
        """Set the input to u from time t on."""
        one = self.knots[self.knot]
        if self.follows != AT_ONCE:
            one[3] = followed(self.follows, one[1], 0.0, one[3], max(t - one[0], 0.0))
            one[0] = t
        one[1] = self.start + self.slope * u

    def acts(self) -> tuple[str, int, float]:
        """Return (table, knot, its rate of change with the input)."""
        return "drives", self.knot, self.slope


class InputInKnots(NamedTuple):
    """The input u of a force on bodies, in the knots of a table from one of them on."""

    force: DrivenByKnots
    table: str
    knots: Array
    knot: int

    @property
    def u(self) -> float:
        return self.force.input_in(self.knots[self.knot :])

    def put(self, u: float, t: float) -> None:
        """Set the input to u."""
        self.force.put_input(self.knots[self.knot :], u)

    def acts(self) -> tuple[str, int, float]:
        """Return (table, knot, its rate of change with the input)."""
        return self.table, self.knot, self.force.slope_of_input(self.u)


class InputOfStates(NamedTuple):
    """The constant input of a part with states, which is a number in the program of a run."""

    force: Driven
    row: Array

    @property
    def u(self) -> float:
        return float(self.row[NUMBER_AT])

    def put(self, u: float, t: float) -> None:
        """Set the input to u."""
        self.row[NUMBER_AT] = u

    def acts(self) -> tuple[str, int, float]:
        """Raise InputError: one step has no derivatives by a number of a program."""
        text = f"is the {self.force.INPUT} of a {self.force.kind}, by which one step has no "
        text += "derivatives; use "
        text += f"simulate(inputs={{{self.force.name!r}: ...}}, wrt=['inputs.{self.force.name}'])"
        raise InputError(Problem("Stepper.linearise", f"'{self.force.name}'", text))


class Inputs:
    """The inputs and the targets that can be set in the tables of a run.

    Values that are read by expressions are not set here.
    """

    def __init__(self, forces: Sequence[Force], drives: Drives, loads: Loads, read: Container[str]):
        self._drives = drives.knots
        self.servos: dict[str, int] = {}  # the knot of each target
        self.known: dict[str, Input | InputInKnots | InputOfStates] = {}
        driving = [f for f in forces if isinstance(f, OnJoint)]
        rows = drives.table[[*KNOTS, *FOLLOWS]][drives.passive :].tolist()
        for f, (first_target, targets, first_torque, torques, *follows) in zip(driving, rows):
            if f.name in read or f._varies:
                continue
            if isinstance(f, Servo) and targets == 1 and not f.has_state:
                self.servos[f.name] = first_target
            gain, kp, torque = f.law.gain, f.law.kp, f.law.torque
            if f.aims and targets == 1:
                place = f, drives.knots, first_target, 0.0, gain / kp
                self.known[f.name] = Input(*place, tuple(follows))
            elif not f.aims and torques == 1 and not isinstance(torque, Table):
                start: Any = 0.0 if f.integrates else torque
                place = f, drives.knots, first_torque, start, gain
                self.known[f.name] = Input(*place, tuple(follows))
        for i, (n, row) in rows_of_loads(forces, loads).items():
            f = forces[i]
            if isinstance(f, DrivenByKnots) and not f._varies:
                at = Loads._fields[n - 1], loads[n - 1][1], int(row["first_knot"])
                self.known[f.name] = InputInKnots(f, *at)

    def add_of_states(self, forces: Sequence[Force], code: Array, rows: Mapping[str, int]) -> None:
        """Add the parts with states whose input is a number in these rows of the program."""
        for f in forces:
            if isinstance(f, Driven) and f.name in rows:
                self.known[f.name] = InputOfStates(f, code[rows[f.name]])

    def values(self) -> dict[str, float]:
        """Return the values of the inputs by name."""
        return {name: x.u for name, x in self.known.items()}

    def all_checked(self, inputs: Any) -> list[tuple[str, float]]:
        """Return checked values by name. Raises InputError."""
        if not isinstance(inputs, Mapping):
            text = f"must be a dictionary {{name: value}}, got {shown(inputs)}"
            raise InputError(Problem("Stepper.step", "inputs", text))
        return [(name, self.checked(name, value)) for name, value in inputs.items()]

    def checked(self, name: str, value: Any) -> float:
        """Return a checked value. Raises InputError."""
        if name not in self.known:
            text = f"no constant input is named {shown(name)}; {one_of(self.known)}"
            raise InputError(Problem("Stepper.input", "name", text))
        u = float(finite("value", [value], 1)[0])
        if text := self.known[name].force.input_problem(u):
            raise InputError(Problem("Stepper.input", f"'{name}'", text))
        return u

    def put(self, name: str, u: float, t: float) -> None:
        """Set an input to u from time t on."""
        self.known[name].put(u, t)

    def aim(self, servo: str, value: Any) -> None:
        """Set the target of a servo. Raises InputError."""
        if servo not in self.servos:
            text = f"no servo with a constant target is named {shown(servo)}; {one_of(self.servos)}"
            if servo in self.known:
                text += (
                    f"; of a drive that is no servo, set the input: stepper.input({servo!r}, value)"
                )
            raise InputError(Problem("Stepper.target", "servo", text))
        if servo in self.known:  # all with a gain
            self.checked(servo, value)
        self._drives[self.servos[servo], 1] = finite("value", [value], 1)[0]

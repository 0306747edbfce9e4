"""Inputs and targets that stay constant in the tables of a stepper until the user sets them."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from typing import Any, NamedTuple

from ..dynamics.arguments import finite
from ..errors import InputError, Problem, one_of, shown
from ..forces import OnJoint
from ..model import Force, Servo, Table
from ..packing import Drives
from ..packing.forces import AT_ONCE, FOLLOWS, Follows, followed
from .options import first_of

KNOTS = ("first_target", "targets", "first_torque", "torques")  # fields that locate inputs


class Input(NamedTuple):
    """An input u, whose knots have the values start + slope u."""

    force: OnJoint
    knot: int
    start: float
    slope: float
    follows: Follows  # dynamics of the effective value


class Inputs:
    """The inputs and the targets that can be set in the tables of a run.

    Values that are read by expressions are not set here.
    """

    def __init__(self, forces: Sequence[Force], drives: Drives, read: Container[str]):
        self.knots = drives.knots
        self.servos: dict[str, int] = {}  # the knot of each target
        self.known: dict[str, Input] = {}
        driving = [f for f in forces if isinstance(f, OnJoint)]
        rows = drives.table[[*KNOTS, *FOLLOWS]][drives.passive :].tolist()
        for f, (first_target, targets, first_torque, torques, *follows) in zip(driving, rows):
            if f.name in read or f._varies:
                continue
            if isinstance(f, Servo) and targets == 1 and not f.has_state:
                self.servos[f.name] = first_target
            gain, kp, torque = f.law.gain, f.law.kp, f.law.torque
            if f.aims and targets == 1:
                self.known[f.name] = Input(f, first_target, 0.0, gain / kp, tuple(follows))
            elif not f.aims and torques == 1 and not isinstance(torque, Table):
                start: Any = 0.0 if f.integrates else torque
                self.known[f.name] = Input(f, first_torque, start, gain, tuple(follows))

    def values(self) -> dict[str, float]:
        """Return the values of the inputs by name."""
        return {
            name: float((self.knots[x.knot, 1] - x.start) / x.slope)
            if x.slope
            else first_of(getattr(x.force, x.force.INPUT))
            for name, x in self.known.items()
        }

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
        _, knot, start, slope, follows = self.known[name]
        one = self.knots[knot]
        if follows != AT_ONCE:
            one[3] = followed(follows, one[1], 0.0, one[3], max(t - one[0], 0.0))
            one[0] = t
        one[1] = start + slope * u

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
        self.knots[self.servos[servo], 1] = finite("value", [value], 1)[0]

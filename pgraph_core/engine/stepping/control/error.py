"""The error control of a run: its tolerances, its scales so far, and the last error.

The error of the last step over its tolerance is 1e-4 before the first one, and at least, so that
the next width does not follow from rounding ([Hairer & Wanner 1996], section IV.8).
"""

from typing import Any

import numpy as np

from ...compiler.jit import part
from ...records import CHOSEN, GIVEN

# -- in kernels -----------------------------------------------------------------------------------


@part
def note_scales(error, found):
    """Keep the fastest rotation, the fastest translation and the largest way so far."""
    error.spin, error.speed, error.length = found


@part
def note_acceleration(error, a):
    """Keep the largest mean acceleration of a step so far."""
    error.steepest = max(error.steepest, a)


@part
def note_error(error, size):
    """Keep the error of an accepted step over its tolerance, for the next width."""
    error.last_error = max(size, 1e-4)


@part
def accept_step(error):
    """Note that the last step was accepted."""
    error.rejected = 0


@part
def reject_step(error, why):
    """Note that the last step was rejected: 1 not finite, 2 not solved, 0 its error."""
    error.rejected = 1
    error.broken = why


@part
def take_width(error, h):
    """Take given steps of width h from now on."""
    error.widest = h


# -- in Python ------------------------------------------------------------------------------------


def begin(error: Any, length: float, project: bool) -> None:
    """Begin a run of a mechanism of this length [m], whose steps may end on the constraints."""
    error["length"], error["project"] = length, project
    begin_again(error)


def begin_again(error: Any) -> None:
    """Choose the next width as if no step had been taken."""
    error["rejected"], error["last_error"] = 0, 1e-4


def choose_widths(error: Any, rtol: float = 0.0, atol: float = 0.0, widest: float = np.inf) -> None:
    """Choose widths, at most `widest` [s], by their error with these tolerances."""
    error["widths"] = CHOSEN
    error["rtol"], error["atol"], error["widest"] = rtol, atol, widest


def take_given_widths(error: Any, rtol: float) -> None:
    """Take given widths, and solve the equations of steps to `rtol`."""
    error["widths"], error["rtol"] = GIVEN, rtol


def tighten(error: Any, factor: float) -> None:
    """Divide the relative tolerance by a factor."""
    error["rtol"] /= factor


def set_width(error: Any, h: float) -> None:
    """Set the width of given steps, or the largest of chosen ones [s]."""
    error["widest"] = h


def go_on(error: Any, before: Any) -> None:
    """Keep what the control before has found of the motion."""
    error["steepest"] = before["steepest"]

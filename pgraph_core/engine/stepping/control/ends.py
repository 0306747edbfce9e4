"""The ends of steps: corners, edges, changes of comparisons, and the count of given steps."""

import math
from typing import Any

import numpy as np

from ...compiler.jit import part

# -- in kernels: corners, edges and events --------------------------------------------------------


@part
def pass_to_corner(ends, k):
    """Make corner k the next one."""
    ends.corner = k


@part
def note_edge(ends, t):
    """Note that a step ended at a corner or edge at time t."""
    ends.edge = t


@part
def note_change(ends, t):
    """Note an event, or a change of a comparison of the motion, at time t."""
    ends.change = t


# -- in kernels: comparisons of the motion --------------------------------------------------------


@part
def hold_sides(ends):
    """Note that comparisons are held with their results at Y, whose ranges are not known."""
    ends.sided = 1
    ends.clear = -math.inf


@part
def release_sides(ends):
    """Note that the results of comparisons are determined again before the next step."""
    ends.sided = 0


@part
def set_clear(ends, t):
    """Set the time until which results are valid within the ranges of the state."""
    ends.clear = t


@part
def slide_along(ends, i, share):
    """Slide along the margin of the comparison in row i with this share of its true branch."""
    ends.slid = i
    ends.share = share


@part
def leave_margin(ends):
    """Slide along no margin any more."""
    ends.slid = 0
    ends.sided = 0


@part
def pass_piece(ends):
    """Take one of the pieces in which a finer run divides the way to a change."""
    ends.pieces = (ends.pieces if ends.pieces > 0 else ends.parts) - 1


@part
def end_pieces(ends):
    """Note that no change lies ahead in this step."""
    ends.pieces = 0


@part
def set_least(ends, w):
    """Set the least width of a step that ends at a change."""
    ends.shut = w


# -- in kernels: given steps ----------------------------------------------------------------------


@part
def begin_interval(ends, steps):
    """Begin an interval between frames of so many given steps."""
    ends.left = steps


@part
def count_from(ends, t):
    """Count given steps from time t on."""
    ends.origin = t
    ends.taken = 0


@part
def add_part(ends, h):
    """Add a finished part of width h of a given step."""
    ends.done += h


@part
def count_steps(ends, n):
    """Count n finished given steps."""
    ends.done = 0.0
    ends.taken += n
    ends.left -= n


# -- in Python ------------------------------------------------------------------------------------


def begin(ends: Any, t: float, parts: int, lag: float, samples: int, edges: int) -> None:
    """Begin a run at time t whose given steps are divided into `parts`.

    `lag` is the shortest lag of an input [s]. `samples` counts the sampled states of controls, and
    `edges` the comparisons of times.
    """
    ends["origin"] = ends["edge"] = t
    ends["change"] = -np.inf
    ends["parts"], ends["lag"], ends["samples"], ends["edges"] = parts, lag, samples, edges


def start_count(ends: Any, t: float) -> None:
    """Count given steps from time t on."""
    ends["origin"], ends["taken"] = t, 0


def set_left(ends: Any, left: int) -> None:
    """Set the number of given steps until the next frame."""
    ends["left"] = left


def go_on(ends: Any, before: Any) -> None:
    """Go on with the given steps of the control before."""
    for name in ("origin", "taken", "left", "done"):
        ends[name] = before[name]


def add_steps(ends: Any, which: Any, n: int) -> None:
    """Count n finished given steps of the runs `which`."""
    ends["taken"][which] += n

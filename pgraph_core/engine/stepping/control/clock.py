"""The clock of a run: its time, its last step, the next width, and what is known at its state."""

import math
from typing import Any

from ...compiler.jit import part

# -- in kernels -----------------------------------------------------------------------------------


@part
def set_time(clock, t):
    """Set the time of the state to t, at which the same is known."""
    clock.time = t


@part
def jump_to(clock, t):
    """Set the time of another state, or of another slope, to t."""
    clock.time = t
    clock.fresh = 0


@part
def end_step(clock, h, t):
    """End a step of width h at time t, which may differ from the sum of both by rounding."""
    clock.old_time = clock.time
    clock.old_width = h
    clock.time = t
    clock.filled = 0
    clock.repeated = 0


@part
def end_step_of(clock, given):
    """End the step that another clock has ended, in a run of derivatives."""
    clock.old_time = given.old_time
    clock.old_width = given.old_width
    clock.time = given.time
    clock.filled = 0


@part
def begin_step_of(clock, given):
    """Return to the start of the last step of another clock."""
    clock.time = given.old_time
    clock.clip = given.clip


@part
def set_last_step(clock, t, h):
    """Make the step of width h from time t the one whose dense output is evaluated."""
    clock.old_time = t
    clock.old_width = h
    clock.filled = 0


@part
def shorten_last_step(clock, h):
    """Shorten the last step to the width h."""
    clock.old_width = h


@part
def try_width(clock, h):
    """Try the next step with width h."""
    clock.width = h


@part
def clip_stages(clock, t):
    """Evaluate no stage of the next step later than t."""
    clock.clip = t


@part
def keep_slope(clock):
    """Note that SLOPE belongs to Y."""
    clock.fresh = 1


@part
def forget_slope(clock):
    """Note that SLOPE does not belong to Y."""
    clock.fresh = 0


@part
def keep_dense_output(clock):
    """Note that the further stages of dense output are known."""
    clock.filled = 1


@part
def note_repeated(clock, how):
    """Note that the stages are those of a repeated step, or of a part of it."""
    clock.repeated = how


@part
def pass_frame(clock):
    """Go on to the next frame."""
    clock.frame += 1


@part
def note_failure(clock, t, row):
    """Note the time of the failure of a run, and the row that moved fastest."""
    clock.failed = t
    clock.fastest = row


@part
def pass_steps(clock, start, h, t):
    """Pass steps that lanes have taken: the last one from `start` with width h to time t."""
    clock.old_time = start
    clock.old_width = h
    clock.time = t
    clock.filled = 0
    clock.fresh = 0
    clock.clip = math.inf


# -- in Python ------------------------------------------------------------------------------------


def begin(clock: Any, times: Any, span: float, most: int) -> None:
    """Begin a run with frames at `times`, at most so many steps, and a typical time `span` [s]."""
    clock["time"], clock["last"] = times[0], len(times)
    clock["span"], clock["most"] = span, most


def go_on(clock: Any, before: Any) -> None:
    """Go on from the time and the frames of the clock before."""
    for name in ("time", "frame", "last"):
        clock[name] = before[name]


def set_frames(clock: Any, recorded: int, last: int) -> None:
    """Set the number of frames that are recorded already, and until which the run goes on."""
    clock["frame"], clock["last"] = recorded, last


def forget(clock: Any) -> None:
    """Forget v' at the state of a run, and the further stages of its last step."""
    clock["fresh"] = clock["filled"] = 0


def forget_slopes(clocks: Any, which: Any) -> None:
    """Forget v' at the states of the runs `which`."""
    clocks["fresh"][which] = 0


def set_times(clocks: Any, which: Any, times: Any) -> None:
    """Set the times of the runs `which`."""
    clocks["time"][which] = times

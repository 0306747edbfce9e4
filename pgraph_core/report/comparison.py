"""work_precision: every method at every setting, its error, and its time in shuffled rounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..mechanism import Mechanism
from . import asked
from . import reference as references
from .ladder import ladder
from .study import Study
from .task import Task, start
from .work import Work

FRAMES = 101  # times at which motions are compared, where nothing else is said
LONGEST = 1.0  # s a run may take


def work_precision(
    mech: Mechanism,
    q: Any = None,
    v: Any = None,
    *,
    t_end: float | None = None,
    methods: Sequence[str] | str | None = None,
    steps: Any = None,
    tolerances: Any = None,
    fixed: bool = False,
    reference: Any = None,
    rounds: int = 5,
    clock: str = "wall",
    scenario: str | None = None,
    tau: Any = None,
    stabilise: str | None = "project",
    target: float | None = None,
    frames: int = FRAMES,
    peers: Sequence[str] = (),
    longest: float = LONGEST,
    progress: Callable[[float], Any] | None = None,
) -> Study:
    """Error against run time of `methods` on the motion that `simulate` would make.

    Methods that choose their steps run at `tolerances` (1e-2 .. 1e-12), the others at `steps`
    [s] (h0 2^-k, k = 0 .. 8); `fixed` gives steps to all. Errors are without unit, over `frames`
    times (docs/report.md), against `reference`: a Result, (t, q), a Case, a Reference, or by
    default the finest run there is, whose own error is estimated and printed. `peers` are names
    of other engines ("mujoco", "pinocchio", "exudyn"). `clock="processor"` does not count what
    other programs take, on a machine that is not quiet. A run of more than `longest` seconds is
    left out. `progress(fraction)` is called now and then; where it returns False the study ends
    with what it has, `cancelled`.

    Raises InputError for arguments that do not fit. A run that fails stays in the table.
    """
    duration = asked.duration(mech, t_end, scenario)
    asked.check(rounds, frames, target, longest)
    q0, v0 = start(mech, scenario, q, v)
    task = Task(mech, q0, v0, np.linspace(0.0, duration, frames), scenario, tau, stabilise)
    given = None
    if reference is not None:
        given = references.given(task, reference)
        task = replace(task, t=given.t)
    rate = task.fastest_rate()
    rungs = ladder(steps, tolerances, task.spacing, rate, task.t_end)
    names = asked.names(methods, task)
    work = Work(task, progress, longest, rounds, asked.clock(clock))
    return work.study(names, rungs, fixed, given, rate, target, asked.peers(peers))

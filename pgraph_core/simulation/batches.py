"""simulate_batch: many runs of one mechanism at once, from states and numbers of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.batch import Batch, some
from ..engine import layout as at
from ..engine.compiler.address import unnamed
from ..engine.compiler.lane import LANE_WIDTH
from ..engine.stepping import batch as kernels
from ..errors import InputError, Problem, explained
from ..integrators import Method, method_of
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..packing.system import Array
from .options import fixed_step_times, steps_between


class BatchResult(NamedTuple):
    """States of all instances over time; an instance that stopped being finite holds nan."""

    t: Array  # (frames,) [s]
    q: Array  # (m, frames, nq)
    v: Array  # (m, frames, nv)
    finite: Any  # (m,) bool


@explained
def simulate_batch(
    mech: Mechanism | Model,
    q: Any,
    v: Any,
    *,
    t_end: float,
    step: float = 1e-3,
    method: str = "auto",
    tau: Any = None,
    frames: int | None = 2,
    t_eval: Any = None,
    models: Sequence[Model] | None = None,
    threads: int | None = None,
    constraints: str | None = None,
    progress: Callable[[float], Any] | None = None,
) -> BatchResult:
    """Run m instances from q (m, nq), v (m, nv) under constant tau (m, nv).

    Springs, dampers and all forces of the model act. Constraints, contacts and joint limits do
    not, and `constraints="ignore"` must say so where the model has some. Other arguments are those
    of `simulate` and `Batch`. Raises InputError for arguments that do not fit.
    """
    mech = mechanism_of(mech, "simulate_batch")
    size = None if models else len(q)
    batch = Batch(mech, size, models=models, threads=threads, constraints=constraints)
    chosen = _given_steps(method)
    times = fixed_step_times(0.0, float(t_end), float(step), frames, t_eval)
    substeps, width = steps_between(times, float(step))
    state = (batch.lanes("q", q, mech.nq).copy(), batch.lanes("v", v, mech.nv).copy())
    given = batch.given(tau)
    shape = (batch.blocks, len(times))
    out = tuple(np.empty((*shape, n, LANE_WIDTH)) for n in (mech.nq, mech.nv))
    tableau = chosen.tableau[:3]
    forces = mech.model.forces
    rows = at.STAGE + chosen.evaluations
    acts = (unnamed(mech.packed.drives(forces)), some(mech.packed.loads(forces)))
    system = (mech.packed.system.rows, batch.const, *acts, tableau, times, substeps, width)
    reached = 0
    for first, last in _chunks(substeps, len(times)):

        def work(begin: int, end: int, space: Array, span: Any = (first, last)) -> None:
            stages = np.zeros((rows, mech.nq + mech.nv, LANE_WIDTH))
            kernels.run(*system, *state, given, space, stages, out, *span, begin, end)

        batch.spread(work)
        reached = last
        if progress is not None and progress(last / len(times)) is False:
            break
    qs, vs = (batch.rows(x[:, :reached]) for x in out)
    return BatchResult(times[:reached], qs, vs, np.isfinite(vs[:, -1]).all(axis=1))


def _given_steps(name: str) -> Method:
    """The method called `name`, one that takes fixed steps. Raises InputError."""
    chosen = method_of("rk4" if name == "auto" else name)
    if chosen.adaptive or not chosen.starts:
        text = f"a batch takes rk4 or semi_implicit_euler; given {name!r}"
        raise InputError(Problem("simulate_batch", "method", text))
    return chosen


def _chunks(substeps: Any, frames: int, steps: int = 2000) -> list[tuple[int, int]]:
    """Frame ranges of about `steps` steps, between which progress is reported."""
    taken = np.concatenate(([0], np.cumsum(substeps)))
    group = (taken // steps).astype(int)
    starts = np.flatnonzero(np.diff(group, prepend=-1)).tolist()
    return list(zip(starts, [*starts[1:], frames]))

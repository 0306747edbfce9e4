"""The tables of the kernels: every record type, field by field, with its unit.

A kernel takes a table as an array of records and reads `point.force`; Python builds the same
array with `table(POINT, n)` and reads `points["force"]`. Records are aligned, so that compiled
code loads a field as fast as an entry of a plain array. What also runs in SIMD lanes (`rows`,
`const`, `work`) is no record: its columns are in `layout`.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba import types

from .compiler.jit import JIT

REAL, INTEGER = np.float64, np.int64


def record(**fields: Any) -> np.dtype[Any]:
    """An aligned record type; a field is a type, or a type with a shape."""
    split = {name: kind if isinstance(kind, tuple) else (kind,) for name, kind in fields.items()}
    return np.dtype([(name, *kind) for name, kind in split.items()], align=True)


def table(kind: np.dtype[Any], *shape: int) -> Any:
    """An array of records, all zero."""
    found = np.zeros(shape, kind)
    return found if JIT else found.view(np.recarray)  # without a compiler, fields are attributes


def by_name(one: Any) -> dict[str, Any]:
    """A record as Python numbers by their names."""
    return dict(zip(one.dtype.names, one.item()))


def array_of(kind: np.dtype[Any]) -> types.Array:
    """The compiler's type of a contiguous array of records."""
    return types.Array(numba.from_dtype(kind), 1, "C")


# -- runs ------------------------------------------------------------------------------------------

STEP_CONTROL = record(
    time=REAL,  # of the state [s]
    width=REAL,  # the step to try next [s]
    old_time=REAL,  # of the state before the last step [s]
    old_width=REAL,  # of the step from there [s]
    clip=REAL,  # stages are not taken later: left of a corner of a table [s]
    last_error=REAL,  # of the last accepted step, over the tolerance
    rtol=REAL,  # relative to the scales below
    atol=REAL,  # absolute, for every coordinate
    widest=REAL,  # the largest step [s]
    span=REAL,  # length of the run [s]
    length=REAL,  # of the mechanism, or as far as it slid [m]
    spin=REAL,  # the fastest rotation so far [rad/s]
    speed=REAL,  # the fastest translation so far [m/s]
    jacobian_rate=REAL,  # of Newton's method; of ROS2, steps with this Jacobian; large: none
    jacobian_time=REAL,  # time of the Jacobian [s]
    factored=REAL,  # width for which the matrices are factored [s]
    fixed=INTEGER,  # 1: steps are as wide as `widest`, whatever their error
    fresh=INTEGER,  # 1: SLOPE belongs to Y
    filled=INTEGER,  # 1: the further stages of dense output are known
    fired=INTEGER,  # 1: an event waits to be reported
    rejected=INTEGER,  # 1: the last step was rejected
    broken=INTEGER,  # why: 1 not finite, 2 not solved
    corner=INTEGER,  # the next corner of a table
    most=INTEGER,  # steps allowed
)

COUNTERS = record(
    steps=INTEGER,
    evaluations=INTEGER,
    projections=INTEGER,
    solver_iterations=INTEGER,
    rejected_steps=INTEGER,
    jacobians=INTEGER,
    factorisations=INTEGER,
    newton_iterations=INTEGER,
)

CURSOR = record(
    frame=INTEGER,  # the next frame
    taken=INTEGER,  # steps taken towards it
    fresh=INTEGER,  # 1: the last frame left v' of the state for the next step
)

CLOCK = record(
    done=REAL,  # how much of the step under way is done [s]
    event=REAL,  # time of the last event [s]
)

"""Width of the number type that carries derivatives, defined in `lowering.dual`.

A dual is a value and WIDTH - 1 derivatives side by side. An array of duals is a C-contiguous array
of float64 with a last axis of length WIDTH, whose entry 0 is the value.
"""

from __future__ import annotations

from typing import Any

from .jit import late

WIDTH = 8  # number of doubles in the widest vector registers, the same on every processor


def of_numbers(function: Any) -> Any:
    """A function of (user, t, q, v, tau) for numbers. For duals the result is nan, and it is never
    called."""
    return late("dual", "of_numbers", function, function)


carries: Any = late("dual", "carries", lambda x: False)  # whether an array holds duals
duals: Any = late("dual", "duals")  # a float64 array (..., WIDTH) as one of duals
parted: Any = late("dual", "parted")  # the way back
revalued: Any = late("dual", "revalued")  # the derivatives of a dual, with another value

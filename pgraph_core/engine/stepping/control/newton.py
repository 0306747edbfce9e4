"""The state of Newton's method in a run: its Jacobian, the factors and the rate of convergence."""

import math
from typing import Any

import numpy as np

from ...compiler.jit import part

# -- in kernels -----------------------------------------------------------------------------------


@part
def keep_jacobian(newton, t):
    """Note a new Jacobian, at time t, which is not factored."""
    newton.jacobian_time = t
    newton.factored = 0.0


@part
def keep_factors(newton, h):
    """Note that the matrices are factored for the width h."""
    newton.factored = h


@part
def forget_factors(newton):
    """Note that the matrices are not factored."""
    newton.factored = 0.0


@part
def keep_rate(newton, rate):
    """Keep the rate of convergence, for the choice of the next iteration."""
    newton.jacobian_rate = rate


@part
def want_jacobian(newton):
    """Evaluate the Jacobian again before the next iteration."""
    newton.jacobian_rate = math.inf


# -- in Python ------------------------------------------------------------------------------------


def begin(newton: Any) -> None:
    """Begin without a Jacobian."""
    newton["jacobian_rate"], newton["jacobian_time"] = np.inf, np.nan


def factor_again(newton: Any) -> None:
    """Evaluate the Jacobian again before the next iteration, but for one of this time."""
    newton["jacobian_rate"] = np.inf

"""Slopes of functions of a run, along its sensitivities to parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError, ModelError, Problem
from ..tolerances import EPS

# weights of f(x + k h) for 2 h f'(x): central, and on one side if the other is invalid
SLOPES = ({1: 1, -1: -1}, {0: -3, 1: 4, 2: -1}, {0: 3, -1: -4, -2: 1})
BESIDE = np.cbrt(EPS)  # rad, m, or of a number: where rounding and curvature are about equal


def slope_along(run: Any, function: Callable[[Any], Any], path: str) -> Any:
    """Return the derivative of a function of a run along its sensitivity to what `path` names."""
    source, moves = run.derivatives.source, np.abs(run.sensitivity(path))
    step = BESIDE / max(float(np.nanmax(moves, initial=0.0)), 1.0 / source.scale_of(path))
    refused: ModelError | None = None
    for weights in SLOPES:
        try:
            parts = [
                weight * np.asarray(function(source.beside(run, path, k * step)), float)
                for k, weight in weights.items()
            ]
            slope = np.asarray(sum(parts) / (2.0 * step))
            return slope if slope.ndim else float(slope)
        except ModelError as error:  # on this side no model is valid
            refused = error
        except IndexError as error:
            if not run.user_events:
                raise
            text = "events have no derivatives, but t, q and v of the last frame have, at which "
            text += "a terminal event ends a run"
            raise InputError(Problem("gradient", "function", text)) from error
    assert refused is not None
    raise refused

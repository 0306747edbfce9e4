"""Derivatives of the columns of a run, and of metrics of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..result import Result
from ..result.columns import columns_of, coordinates, meant
from ..result.functions import WAYS
from ..result.records import Status
from ..result.slopes import BESIDE
from ..sweeps.metrics import OF_RUN, words

Array = np.ndarray


def slopes_of(run: Result, wanted: Sequence[str]) -> dict[str, list[Array]]:
    """Return the derivatives (n,) of columns by each path of a run.

    Those of coordinates and velocities are known. The others are differentiated along them.
    """
    places = {}
    for n, (kind, listed) in enumerate(zip(("", "v."), coordinates(run.mechanism))):
        places |= {f"{kind}{name}": n * run.q.shape[1] + k for k, (name, _) in enumerate(listed)}
    named = run.mechanism.model.parameters
    ours = [column for column in wanted if column not in places or column in named]
    others = {}
    if ours:

        def read(run: Result) -> Array:
            found = columns_of(run)
            return np.array([found[column].values for column in ours])

        others = run.gradient(read)
    return {
        path: [
            others[path][ours.index(column)] if column in ours else by[:, places[column]]
            for column in wanted
        ]
        for path, by in run.derivatives.items()
    }


def slope_of_metric(run: Result, metric: str) -> dict[str, float] | None:
    """Return the derivatives of a metric of one column by each path, None for other metrics.

    The column moves along its derivatives, by as much as the state in `Result.gradient`.
    """
    way, what = ("", "") if metric in OF_RUN else words(metric)
    known = meant(columns_of(run), what) if way else []
    if len(known) != 1 or run.status is not Status.DONE:  # the times of its frames move, too
        return None
    x, function, found = columns_of(run)[known[0]].values, WAYS[way], {}
    for path, (slope,) in slopes_of(run, known).items():
        largest = float(np.abs(slope).max(initial=0.0))
        h = BESIDE * max(float(np.abs(x).max()), 1.0) / largest if largest > 0.0 else 1.0
        ends = [float(function(run.t, x + side * h * slope)) for side in (1.0, -1.0)]
        found[path] = (ends[0] - ends[1]) / (2.0 * h)
    return found

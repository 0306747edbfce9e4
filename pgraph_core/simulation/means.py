"""Means between some frames of a run, each of which has the mean since the frame before."""

from __future__ import annotations

import numpy as np

from ..packing import Array, Ints


def means_between(t: Array, values: Array, some: Ints) -> Array:
    """Return the means (k, ...) of values (n, ...) since the one before of `some` frames (k,).

    The first one covers the time since the start, and frame 0 keeps its value, which is that of an
    instant. `t` (n,) are the times [s].
    """
    found = values[some]
    later = int(some[0] == 0)  # frames that cover a time
    if len(some) == later:
        return found
    starts = np.concatenate(([1], some + 1))[later : len(some)]
    widths = np.diff(t[: some[-1] + 1]).reshape(-1, *[1] * (values.ndim - 1))
    sums = np.add.reduceat(values[1 : some[-1] + 1] * widths, starts - 1, axis=0)
    apart = (some[later:] - starts > 0).nonzero()[0]
    found[later + apart] = sums[apart] / (t[some[later:]] - t[starts - 1])[apart].reshape(
        -1, *[1] * (values.ndim - 1)
    )
    return found

"""Lanes, triples and the rounding of compiled code."""

import numba
import numpy as np

from pgraph_core.engine.compiler import jit
from pgraph_core.engine.compiler.lane import (
    LANE_WIDTH,
    lanes,
    load_triple,
    numbers,
    store_triple,
    triple,
)

JITTED = numba.njit(**jit.OPTIONS)


def test_lanes_compute_place_by_place():
    @JITTED
    def poly(x, y, out):
        a, b, c = lanes(x), lanes(y), lanes(out)
        for i in range(a.shape[0]):
            c[i] = -(a[i] + b[i]) * 3 / (2.0 - a[i]) + min(b[i], 0.5) - max(a[i], 0.25)
            c[i] += np.floor(0.0)

    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 5, LANE_WIDTH))
    out = np.empty_like(x)
    poly(x, y, out)
    wanted = -(x + y) * 3 / (2.0 - x) + np.minimum(y, 0.5) - np.maximum(x, 0.25)
    assert np.array_equal(out, wanted)




def test_nothing_is_contracted():
    """a b + c with one rounding would give 2⁻¹⁰⁶."""

    @JITTED
    def product(a, b, c):
        return a * b + c

    x = 1.0 + 2.0**-53 * 2
    assert product(x, x, -(x * x)) == 0.0
    assert jit.OPTIONS["fastmath"] is False

"""Our own elementary functions against mpmath, in units in the last place."""

import math
from functools import cache

import mpmath
import numba
import numpy as np
import pytest
from mpmath import mp, mpf

from pgraph_core.engine.compiler import elementary
from pgraph_core.engine.compiler.lane import LANE_WIDTH, lanes
from pgraph_core.engine.compiler.lowering.kinds import OPTIONS

RNG = np.random.default_rng(0)
NEAR = RNG.uniform(-10, 10, 400)
FAR = RNG.uniform(1, 10, 400) * 10.0 ** RNG.integers(4, 308, 400)
HARD = [6381956970095103 * 2.0**797, 1e5, -1e22, 1e300]  # the first is next to a multiple of π/2
ANGLES = np.concatenate((NEAR, FAR, -FAR[:100], HARD, [1e-300]))
TURNS = 0.25 * math.pi * np.arange(-9, 10)  # the doubles next to where tan is 0, 1 and large
ALL_SIZES = RNG.uniform(1, 10, 400) * 10.0 ** RNG.integers(-300, 300, 400)
UNIT = np.concatenate((RNG.uniform(-1, 1, 400), [1, -1, 0.5, -0.5, 1 - 2**-53, 1e-200]))
CASES = {
    "sin": (mpmath.sin, ANGLES),
    "cos": (mpmath.cos, ANGLES),
    "tan": (mpmath.tan, np.concatenate((ANGLES, TURNS))),
    "atan": (mpmath.atan, np.concatenate((ALL_SIZES, -ALL_SIZES, NEAR))),
    "asin": (mpmath.asin, UNIT),
    "acos": (mpmath.acos, UNIT),
    "exp": (mpmath.exp, np.concatenate((RNG.uniform(-744, 709, 400), RNG.uniform(-1, 1, 200)))),
    "log": (mpmath.log, np.append(ALL_SIZES, [*RNG.uniform(0.5, 2, 200), 5e-324, 1 + 2**-52])),
}


@cache
def looped(name, count):
    function = getattr(elementary, name)
    of_two = function if count == 2 else numba.njit(**OPTIONS)(lambda x, _: function(x))

    @numba.njit(**OPTIONS)
    def each(x, y, out):
        for i in range(out.shape[0]):
            out[i] = of_two(x[i], y[i])

    return each


def values(name, *arrays):
    x, y = (np.ascontiguousarray(arrays[k], dtype=float) for k in (0, -1))
    out = np.empty(len(x))
    looped(name, len(arrays))(x, y, out)
    return out


def units(found, exact):
    """Largest error in units in the last place."""
    worst = 0.0
    for got, true in zip(found.tolist(), exact):
        worst = max(worst, float(abs(mpf(got) - true) / mpf(math.ulp(float(true)))))
    return worst


@pytest.mark.parametrize("name", CASES)
def test_one_argument_within_one_unit(name):
    truth, x = CASES[name]
    with mp.workprec(1200):
        assert units(values(name, x), [truth(mpf(v)) for v in x.tolist()]) < 1.0


def test_angles_of_points_within_two_units_in_all_quadrants():
    y, x = RNG.normal(size=(2, 1000)) * 10.0 ** RNG.integers(-5, 5, (2, 1000))
    with mp.workprec(200):
        exact = [mpmath.atan2(mpf(a), mpf(b)) for a, b in zip(y.tolist(), x.tolist())]
        assert units(values("atan2", y, x), exact) < 1.5


def test_powers_within_one_unit_where_results_are_of_usual_size():
    x, y = ALL_SIZES**0.05, RNG.uniform(-3, 3, 400)
    with mp.workprec(200):
        exact = [mpf(a) ** mpf(b) for a, b in zip(x.tolist(), y.tolist())]
        assert units(values("power", x, y), exact) < 1.0


EDGES = [0.0, -0.0, math.inf, -math.inf, math.nan, 1.0, -1.0, 2.0, 1e-320, 1e308]


@pytest.mark.parametrize("name", CASES)
def test_edges_are_those_of_the_library(name):
    library = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}.get(name, name)
    with np.errstate(all="ignore"):
        wanted = getattr(np, library)(np.array(EDGES))
    np.testing.assert_allclose(values(name, EDGES), wanted, rtol=4e-16)


def test_edges_of_two_arguments_are_those_of_the_library():
    x, y = (a.ravel() for a in np.meshgrid(EDGES, EDGES))
    plain = ~((x == 0.0) & (y == 0.0))  # whose signs are not told apart
    with np.errstate(all="ignore"):
        angles, powers = np.arctan2(y, x), np.power(np.abs(x), y)
    np.testing.assert_allclose(values("atan2", y, x)[plain], angles[plain], rtol=4e-16)
    known = ~(np.isnan(y) & (x == 1.0)) & ~np.isnan(x) & (np.abs(x) != 1.0)
    np.testing.assert_allclose(values("power", np.abs(x), y)[known], powers[known], rtol=1e-15)


def test_lanes_have_the_bits_of_numbers():
    @numba.njit(**OPTIONS)
    def of_lanes(y, x, angle, sine):
        a, b, c, d = lanes(y), lanes(x), lanes(angle), lanes(sine)
        for i in range(a.shape[0]):
            c[i] = elementary.atan2(a[i], b[i])
            d[i], _ = elementary.sine_cosine(a[i])

    y, x = RNG.normal(size=(2, 50, LANE_WIDTH))
    angle, sine = np.empty_like(x), np.empty_like(x)
    of_lanes(y, x, angle, sine)
    assert np.array_equal(angle.ravel(), values("atan2", y.ravel(), x.ravel()))
    assert np.array_equal(sine.ravel(), values("sin", y.ravel()))

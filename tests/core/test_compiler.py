"""Types and calls that the compiler adds to numba: lanes, triples, addresses of kernels."""

from typing import NamedTuple

import numba
import numpy as np
from numba import types

from pgraph_core.engine.arrays import named
from pgraph_core.engine.compiler import address, jit
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


def test_triples_go_from_and_to_memory():
    @JITTED
    def move(a, out):
        x = load_triple(a, 0, 1) + 2.0 * triple(1.0, 2.0, 3.0)
        store_triple(out, 1, 0, x)
        return numbers(x)

    a, out = np.arange(8.0).reshape(2, 4), np.zeros((2, 4))
    assert move(a, out) == (3.0, 6.0, 9.0)
    assert out.tolist() == [[0, 0, 0, 0], [3, 6, 9, 0]]


class Pair(NamedTuple):
    """A row of numbers, and a count."""

    row: object
    count: object


class Nested(NamedTuple):
    """A pair, and more."""

    pair: object
    more: object


def test_named_tuples_are_opened_as_they_were_saved_and_by_their_first_member():
    pair = named(Pair, types.float64[::1], types.int64)
    save, opened = address.stored(named(Nested, pair, types.int64))
    _, opened_pair = address.stored(pair)

    @JITTED
    def keep(buffer, value):
        save(buffer, value)

    @JITTED
    def look(place):
        nested = opened(place)
        return nested.pair.row[1] + nested.pair.count + nested.more + opened_pair(place).row[0]

    buffer, row = address.buffer(), np.array([10.0, 200.0])
    keep(buffer, address.unnamed(Nested(Pair(row, 3000), 40000)))
    assert look(address.address_of_array(buffer)) == 43210.0


def test_kernels_are_called_by_address():
    signature = types.float64(types.float64, types.float64[::1])
    call = address.caller(signature)

    @JITTED
    def through(place, x, a):
        return call(place, (x, a))

    place = numba.njit(signature)(lambda x, a: x + a[0])
    (found,) = place.overloads.values()
    code = found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name)
    assert through(code, 1.0, np.array([2.0])) == 3.0


def test_nothing_is_contracted():
    """a b + c with one rounding would give 2⁻¹⁰⁶."""

    @JITTED
    def product(a, b, c):
        return a * b + c

    x = 1.0 + 2.0**-53 * 2
    assert product(x, x, -(x * x)) == 0.0
    assert jit.OPTIONS["fastmath"] is False

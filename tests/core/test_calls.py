"""Calls of kernels from Python: what they take, what they refuse, what they return."""

import threading

import numpy as np
import pytest

from pgraph_core.engine.compiler.jit import JIT, Kernel
from pgraph_core.engine.compiler.kinds import F1, F2, array_of, f8, group, i8, none, read, u8, void

pytestmark = pytest.mark.skipif(not JIT, reason="nothing is compiled")
SPOT = np.dtype([("number", np.int64), ("place", np.float64, 3)], align=True)


def tell(n, address, x, a, spots, pair, nothing):
    """Return what arrives of every kind of argument."""
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            total += a[i, j] * (10 * i + j)
    for k in range(spots.shape[0]):
        spots[k].place[2] += spots[k].number
    pair[0][0] = pair[1][0]
    return n + int(address), x, total, int(nothing is None)


def store(out, n):
    for _ in range(n):
        out[0] += 1.0


TELL = Kernel(
    tell, (group(i8, f8, f8, i8)(i8, u8, f8, F2, array_of(SPOT), group(F1, group(f8)), none),)
)
STORE = Kernel(store, (void(F1, i8),), nogil=True)


def arguments(**changed):
    """Return arguments that fit, with some of them changed."""
    spots = np.zeros(2, SPOT)
    spots["number"] = 4, 5
    given = {
        "n": -3, "address": 2**64 - 616, "x": 0.5, "a": np.arange(6.0).reshape(2, 3),
        "spots": spots, "pair": (np.zeros(1), (7.5,)), "nothing": None,
    }  # fmt: skip
    return tuple({**given, **changed}.values())


def test_arguments_of_every_kind_arrive_and_results_come_back():
    given = arguments()
    assert TELL(*given) == (-619, 0.5, 1 + 4 + 30 + 44 + 60, 1)
    assert given[4]["place"][:, 2].tolist() == [4.0, 5.0]
    assert given[5][0].tolist() == [7.5]
    for empty in (np.zeros((0, 3)), np.zeros((2, 0))):
        assert TELL(*arguments(a=empty))[2] == 0.0


@pytest.mark.parametrize(
    "changed",
    [
        {"n": np.int64(-3)}, {"n": np.int32(-3)}, {"x": np.float64(0.5)}, {"x": np.float32(0.5)},
        {"a": np.arange(6, dtype=np.dtype("f8").newbyteorder("=")).reshape(2, 3)},
        {"a": np.arange(12.0).reshape(4, 3)[:2]},
    ],
    ids=str,
)  # fmt: skip
def test_numbers_of_numpy_and_views_are_taken(changed):
    x = TELL(*arguments(**changed))
    assert x[0] == -619
    assert x[1] == 0.5
    assert x[3] == 1


READ_ONLY = np.zeros((2, 3))
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    "changed",
    [
        {"n": 1.0}, {"n": "1"}, {"n": 2**63}, {"n": None},
        {"address": -1}, {"address": 2**64}, {"address": 1.0},
        {"x": "1"}, {"x": np.ones(1)}, {"x": 1j}, {"x": None},
        {"a": np.zeros(6)}, {"a": np.zeros((2, 3), int)}, {"a": np.zeros((3, 2)).T},
        {"a": np.zeros((2, 3), ">f8")}, {"a": np.zeros((2, 3), np.float32)}, {"a": READ_ONLY},
        {"a": [[0.0]]}, {"a": None}, {"a": np.zeros((4, 3))[::2]},
        {"a": np.zeros(49, np.uint8)[1:].view(float).reshape(2, 3)},
        {"spots": np.zeros(2)}, {"spots": np.zeros(2, [("number", int), ("place", float, 2)])},
        {"pair": (np.zeros(1),)}, {"pair": [np.zeros(1), (1.0,)]}, {"pair": (np.zeros(1), 1.0)},
        {"pair": (np.zeros(1), ("1",))}, {"nothing": 0},
    ],
    ids=str,
)  # fmt: skip
def test_what_does_not_fit_is_refused_with_its_place(changed):
    (name,) = changed
    place = list(tell.__code__.co_varnames).index(name) + 1
    with pytest.raises(TypeError, match=f"tell: argument {place} must be"):
        TELL(*arguments(**changed))


def test_what_is_only_read_may_be_read_only():
    def first(x, out):
        out[0] = x[0]

    one, out = Kernel(first, (void(read(F1), F1),)), np.zeros(1)
    given = np.full(1, 4.0)
    given.flags.writeable = False
    one(given, out)
    assert out[0] == 4.0
    with pytest.raises(TypeError, match="argument 2"):
        one(out, given)


def test_too_few_and_too_many_arguments_are_refused():
    for given in (arguments()[:-1], (*arguments(), 1), ()):
        with pytest.raises(TypeError, match="7 arguments"):
            TELL(*given)


def test_a_kernel_without_the_gil_lets_other_threads_run():
    out, begun, turns = np.zeros(1), threading.Event(), 0
    STORE(out, 0)

    def run():
        begun.set()
        STORE(out, 2**29)

    thread = threading.Thread(target=run)
    thread.start()
    begun.wait()
    while thread.is_alive():
        turns += 1
    assert out[0] == 2**29
    assert turns > 1000  # a kernel that holds the GIL leaves a few at its end


def test_a_closed_kernel_refuses_until_it_is_ready():
    one = Kernel(store, (void(F1, i8),))
    one.close()
    with pytest.raises(TypeError):
        one(np.zeros(1), 1)
    one.ready()
    assert one(np.zeros(1), 1) is None


def test_of_several_signatures_the_one_that_fits_is_called():
    def doubled(out, x):
        out[0] = x + x

    one = Kernel(doubled, (void(F1, i8), void(F1, f8)))
    out = np.zeros(1)
    for x in (0.25, 3, 0.5, 1):
        one(out, x)
        assert out[0] == 2 * x
    with pytest.raises(TypeError, match="none of its signatures"):
        one(out, "x")

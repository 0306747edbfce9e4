"""What we rely on inside numba: a version that changes it fails here, by name.

`engine/compiler` is the only folder that knows numba's insides; pyproject.toml bounds its version.
"""

import inspect
import re
import tomllib
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import types
from numba.core import caching, codegen, compiler, cpu, dispatcher, sigutils
from numba.core.typing import templates

from pgraph_core.engine.arrays import named
from pgraph_core.engine.compiler import address, jit
from pgraph_core.engine.compiler.lane import (
    LANE_WIDTH,
    Lane,
    lanes,
    load_triple,
    numbers,
    store_triple,
    triple,
)

JITTED = numba.njit(**jit.OPTIONS)


@pytest.mark.parametrize(
    "name",
    [
        "_optimize_final_module",
        "_finalize_final_module",
        "_finalize_dynamic_globals",
        "get_pointer_to_function",
    ],
)
def test_code_libraries_have_what_parts_override(name):
    assert callable(getattr(codegen.JITCodeLibrary, name))


@pytest.mark.parametrize("name", ["_optimize_functions", "_optimize_final_module"])
def test_code_for_webassembly_skips_the_passes_of_this_machine(name):
    assert callable(getattr(codegen.CPUCodeLibrary, name))


def test_code_learns_its_environment_from_its_library():
    assert "library.codegen.set_env" in inspect.getsource(cpu.CPUContext.get_executable)


def test_the_compiler_takes_its_library_from_its_state():
    assert callable(compiler.CompilerBase.__init__)
    assert callable(compiler.Compiler.define_pipelines)
    assert "state.library" in inspect.getsource(compiler)


def test_the_cache_asks_a_locator():
    assert caching.FunctionCache._impl_class is caching.CompileResultCacheImpl
    assert caching.CompileResultCacheImpl._locator_classes
    for name in ("get_cache_path", "get_source_stamp", "get_disambiguator", "from_function"):
        assert callable(getattr(caching._CacheLocator, name))


def test_a_dispatcher_has_what_kernels_ask_of_it():
    @JITTED
    def twice(x):
        return 2.0 * x

    assert twice._can_compile
    twice.compile((types.float64,))
    (found,) = twice.overloads.values()
    assert found.library.get_pointer_to_function(found.fndesc.llvm_cfunc_wrapper_name) > 0
    twice.disable_compile()
    assert not twice._can_compile
    with pytest.raises(TypeError):
        twice("text")
    assert callable(dispatcher.Dispatcher.get_call_template)
    assert hasattr(twice, "_cache")


def test_signatures_as_text_and_as_types_are_the_same():
    assert sigutils.normalize_signature("f8(f8,i8[::1])")[0] == (types.float64, types.int64[::1])


def test_literals_lose_their_values():
    assert types.unliteral(types.literal(3)) == types.int64


def test_operations_of_own_types_can_be_registered():
    assert callable(templates.infer_global)
    assert issubclass(Lane, types.Type)


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


def test_numba_is_within_the_bounds_that_are_declared():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    (declared,) = (d for d in project["project"]["dependencies"] if d.startswith("numba"))
    low, high = (tuple(map(int, bound.split("."))) for bound in re.findall(r"[\d.]+", declared))
    assert low <= numba.version_info.short < high

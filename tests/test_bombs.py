"""Values that are small to give and large to read: lists in themselves, views, formulas."""

import tracemalloc
import warnings
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

INSIDE: Any = []
INSIDE.append(INSIDE)
TWICE: Any = []
TWICE.extend([TWICE, TWICE])
DEEP: Any = []
for _ in range(100_000):
    DEEP = [DEEP]
CALLS = {
    "columns": lambda x: pg.Model.from_columns([0], mass=x),
    "parent": lambda x: pg.Model.from_columns(x),
    "energy": lambda x: pg.Mechanism(pg.Model.serial(2)).energy(x, [0, 0]),
    "body": lambda x: pg.Body(name="a", com=x),
    "model": lambda x: pg.Model(bodies=x),
    "table": lambda x: pg.Table(t=x, value=x),
    "torques": lambda x: pg.Stepper(pg.Model.serial(2)).step(x),
}


@pytest.mark.parametrize("given", [INSIDE, TWICE, DEEP], ids=["inside", "twice", "deep"])
@pytest.mark.parametrize("call", CALLS)
def test_lists_that_hold_themselves_are_refused(call, given):
    with pytest.raises(pg.PgraphError) as refused:
        CALLS[call](given)
    assert len(str(refused.value)) < 1000


def test_a_shape_is_checked_before_the_array_is_copied():
    mech, huge = pg.Mechanism(pg.Model.serial(2)), np.broadcast_to(1.0, (10**9,))
    batch = pg.BatchStepper(mech, 2)
    tracemalloc.start()
    try:
        for call in (mech.energy, mech.bias_force, mech.forward_dynamics):
            with pytest.raises(pg.InputError, match="1000000000"):
                call(huge, [0, 0])
        with pytest.raises(pg.InputError, match="1000000000"):
            batch.step(huge)
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("entries", [10_001, 1_000_000])
def test_a_model_with_too_many_formulas_is_refused(entries):
    with pytest.raises(pg.ModelError, match=r"formulas.*10000"):
        pg.Model(bodies=[{"name": "a", "com": ["=1"] * entries}])


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("=.5and", 9000),
        *((text, 9) for text in ("=1if", "=0x1for", "=1or", '="\\d"', "=1_0in", "=1is")),
    ],
)
def test_no_formula_makes_python_warn(text, count):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(pg.ModelError) as refused:
            pg.Model(bodies=[{"name": "a", "com": [text] * count}])
    assert len(refused.value.problems) == count
    assert len(str(refused.value)) < 20_000


@pytest.mark.parametrize(("text", "value"), [("=1e3", 1e3), ("=0x1f", 31), ("=1_000/2.", 500)])
def test_numbers_in_all_forms_stay_formulas(text, value):
    assert pg.Model(bodies=[{"name": "a", "mass": text}]).bodies[0].mass == value


def test_a_view_of_memory_is_an_array_like_any_other():
    """It can be written, so that it cannot be hashed."""
    model, times = pg.Model.serial(2), np.linspace(0.0, 0.1, 5)
    run = pg.simulate(model, t_eval=memoryview(times))
    assert np.array_equal(run.q, pg.simulate(model, t_eval=times).q)
    with pytest.raises(pg.InputError, match="shape"):
        pg.Mechanism(model).energy(memoryview(np.zeros((2, 2))), [0, 0])

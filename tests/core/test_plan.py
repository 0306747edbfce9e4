"""What a scene does not need: the plan that says it, and that leaving it out changes nothing."""

from __future__ import annotations

import itertools
import resource
import subprocess
import sys
import time
import tracemalloc

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from benchmarks import forced

from .test_cases import mass

FORCED = {case.part: case for case in forced.cases() if case.method == "rk4"}


def built_in(name):
    return pg.Model.load(pgraph_models.path(name))


# -- leaving out changes nothing ----------------------------------------------------------------


@pytest.mark.parametrize("part", FORCED)
def test_a_needless_part_changes_nothing(part):
    """To 1e-14 of the positions: the part adds zeros, or a row that does not move."""
    case = FORCED[part]
    lean, laden = forced.run(case.lean), forced.run(case.laden)
    assert lean.status.ok
    assert laden.status.ok
    assert forced.apart(lean, laden) <= 1e-14
    assert len(laden.plan.needed) >= len(lean.plan.needed)


def test_the_plan_says_which_part_was_forced_on():
    needed = {part: set(pg.Plan.of(case.laden).needed) for part, case in FORCED.items()}
    lean = set(pg.Plan.of(forced.chain()).needed)
    assert lean == {"tree"}
    assert needed["a limit out of reach"] == lean | {"limits", "impulses"}
    assert needed["a rigid contact far away"] == lean | {"contacts", "impulses"}
    assert needed["a soft contact far away"] == lean | {"contacts", "jacobian"}
    assert needed["a motor without torque"] == lean | {"drives"}
    assert needed["a wrench of zero"] == lean | {"loads"}
    idle = pg.Plan.of(FORCED["an inactive constraint"].laden)
    assert idle.saved["inactive constraints"] == "3 rows an evaluation"


# -- what a plan says -----------------------------------------------------------------------------


def test_the_plan_of_the_stance():
    found = pg.Mechanism(built_in("quadruped")).plan(scenario="stance")
    assert "4 constraints of 12 rows" in found.needed["constraints"]
    assert "15 motors and servos" in found.needed["drives"]
    assert "pelvis" in found.needed["quaternions"]
    assert "no contact: nothing is looked for that may touch" in found.left_out
    assert found.saved["recording"] == "400 numbers a recorded frame"
    assert set(found.needed).isdisjoint(found.saved)
    assert str(found).startswith("needs              16 motions with 21 degrees of freedom")


def test_a_run_says_its_own_plan():
    mech = pg.Mechanism(built_in("quadruped"))
    run = pg.simulate(mech, scenario="stance", t_end=0.01, step=1e-3, method="rk4")
    assert run.plan == mech.plan(scenario="stance", method="rk4")
    assert run.left_out == run.plan.left_out
    assert run.plan.to_dict()["left_out"] == list(run.left_out)


def test_the_plan_depends_on_the_method_where_that_matters():
    model = pg.Model(bodies=(mass("a", stiffness=3.0), mass("b", "a", limits=(-1.0, None))))
    radau = pg.Plan.of(model, method="radau5")
    assert "4 evaluations" in radau.needed["jacobian"]
    explicit = pg.Plan.of(model, method="rk4")
    assert explicit.saved["jacobian"] == "4 evaluations a Jacobian"
    assert "events" in explicit.needed
    assert explicit.needed["limits"] == "1 end of joints watched"
    assert "events" not in pg.Plan.of(model, method="moreau_jean").needed


def test_what_the_plan_knows_of_constraints_is_true():
    for name in pgraph_models.names():
        model = built_in(name)
        for scenario in (None, *(s.name for s in model.scenarios)):
            parts = pg.Plan.of(model, scenario=scenario).parts
            assert len({part.name for part in parts}) == len(parts)


def test_welds_are_counted_as_they_are_merged():
    model = forced.chain()
    mech = pg.Mechanism(model)
    assert mech.plan().saved["welds"] == "1 rows an evaluation"
    assert len(mech.packed.system.rows) - 1 == mech.nb - 1


# -- imports --------------------------------------------------------------------------------------


def loaded_by(program):
    """The modules there are after a program."""
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\nimport sys; print(*sys.modules)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return set(done.stdout.split())


def test_describing_a_model_and_its_plan_loads_neither_compiler_nor_scipy():
    found = loaded_by(
        "import pgraph_core as pg, pgraph_models\n"
        "m = pg.Model.load(pgraph_models.path('quadruped')); pg.Topology.of(m); pg.Plan.of(m)"
    )
    assert found.isdisjoint({"numba", "scipy", "trimesh", "viser", "matplotlib"})


def test_a_headless_run_loads_only_what_it_needs():
    """SciPy's BLAS comes with numba; of the rest of SciPy a run of a tree needs nothing."""
    found = loaded_by(
        "import pgraph_core as pg, pgraph_models\n"
        "m = pg.Mechanism(pg.Model.load(pgraph_models.path('pendulum')))\n"
        "pg.simulate(m, t_end=0.01, step=1e-3)"
    )
    heavy = {f"scipy.{part}" for part in ("sparse", "spatial", "optimize", "interpolate")}
    assert found.isdisjoint(heavy | {"trimesh", "viser", "websockets"})
    assert not any(name.startswith(("pgraph_core.study", "peers")) for name in found)


# -- long runs ------------------------------------------------------------------------------------


def long_run(steps, frames, progress=None):
    """Steps of 0.1 ms of the quadruped in free fall and motion."""
    mech = pg.Mechanism(built_in("quadruped"))
    options = {"method": "rk4", "step": 1e-4, "frames": frames, "estimate": False}
    return pg.simulate(mech, t_end=steps * 1e-4, progress=progress, stabilise=None, **options)


def test_memory_is_that_of_the_recorded_frames():
    """Whatever the number of steps: 20 times as many take no more."""
    long_run(100, 11)  # compiled, imported
    peaks = []
    for steps in (1_000, 20_000):
        tracemalloc.start()
        long_run(steps, 11)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0] + 20_000


@pytest.mark.timed
def test_progress_is_told_and_a_run_ends_soon_after_it_is_asked_to():
    """Within 0.1 s of computation: the kernel returns about every 20 ms."""
    told: list[tuple[float, float]] = []

    def progress(fraction):
        told.append((fraction, time.thread_time()))
        return len(told) < 8

    run = long_run(1_000_000, 101, progress)
    left = time.thread_time() - told[-1][1]
    assert run.status is pg.Status.CANCELLED
    assert [f for f, _ in told] == sorted(f for f, _ in told)
    assert left < 0.1
    assert max(b - a for (_, a), (_, b) in itertools.pairwise(told)) < 0.1


@pytest.mark.nightly
def test_a_million_steps_of_the_quadruped():
    """Memory as the frames demand and no more, by what the system counts."""
    long_run(1000, 1001)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    told: list[float] = []
    run = long_run(1_000_000, 1001, lambda f: told.append(f))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert run.status.ok, run.message
    assert run.counters["steps"] == 1_000_000
    assert grown < 20_000  # KiB; the frames take 1001 x 0.6 kB
    assert len(told) > 50
    assert np.isfinite(run.q).all()

"""The answers of reports and maps, tried: on every built-in model and on ten random ones."""

from __future__ import annotations

import re

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.errors import differences, joint_errors, observer, reach, rms
from pgraph_core.study.task import Task

from .trees import random_case

pytestmark = pytest.mark.nightly

LONGEST = 0.2  # [s] of a motion
FRAMES = 21
SUBJECTS = [*pgraph_models.names(), *(f"random {seed}" for seed in range(10))]


def subject(name: str) -> tuple[pg.Mechanism, str | None]:
    """(a model, its first scenario that no gait drives)."""
    if name.startswith("random"):
        case = random_case(int(name.split()[1]), most=5)
        model, joints = case.model, pg.Mechanism(case.model).joints
        for body, joint in joints.items():  # at home a ball and a hinge of one joint may be alike
            model = model.edit(body, q=tuple(case.q[joint.q]), v=tuple(case.v[joint.v]))
        return pg.Mechanism(model), None
    model = pg.Model.load(pgraph_models.path(name))
    return pg.Mechanism(model), next((s.name for s in model.scenarios if s.gait is None), None)


def by_another_method(mech: pg.Mechanism, method: str, **options) -> pg.Result:
    """The same motion, tightly, by a method that was not advised."""
    impulses = Task(mech, None, None, np.zeros(1), options.get("scenario")).impulses
    for other in ("dop853", "dopri5") if impulses else ("dop853", "radau5", "dopri5"):
        if other != method:
            run = pg.simulate(mech, method=other, rtol=1e-11, estimate=False, **options)
            if run.status.ok:
                return run
    raise AssertionError("no other method reaches the end")


@pytest.mark.parametrize("name", SUBJECTS)
def test_what_a_report_advises_holds(name: str):
    mech, scenario = subject(name)
    found = pg.work_precision(
        mech, scenario=scenario, t_end=LONGEST, frames=FRAMES, rounds=1, longest=0.3, target=1e-5
    )
    answer = re.match(r"Take (\w+) at (step|rtol) ([^ :]+)(?: s)?: error (\S+) in ", found.answer)
    assert answer, found.answer
    method, kind, number, error = answer.groups()
    options = {"t_end": found.t_end, "frames": FRAMES, "scenario": scenario}
    run = pg.simulate(mech, method=method, estimate=False, **{kind: float(number)}, **options)
    other = by_another_method(mech, method, **options)
    observe = observer(mech)
    off = rms(differences(observe(run.q), observe(other.q), reach(mech)))
    assert off < 2.0 * float(error) + 1e-8


@pytest.mark.parametrize("name", SUBJECTS)
def test_what_a_map_advises_holds(name: str):
    mech, _ = subject(name)
    found = pg.stability_map(mech, t_end=LONGEST, steps=(1e-2, 1e-3), budget=200_000)
    answer = re.match(r"Take (\w+) at a step of (\S+) s", found.advice)
    if answer is None:
        assert found.advice.startswith("No method")
        return
    method, step = answer.groups()
    right = [c for c in found.cells if (c.method, c.status) == (method, "OK")]
    assert right
    if found.own is None or not any(c.value == found.own for c in right):
        return
    options = {"t_end": LONGEST, "frames": FRAMES}
    run = pg.simulate(mech, method=method, step=float(step), estimate=False, **options)
    other = by_another_method(mech, method, **options)
    assert joint_errors(mech, run.q, other.q).max() < 1.5 * found.target

"""The advice of reports and stability maps, tried: a run by it against another method's."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.axes import AXES
from pgraph_core.study.measures import differences, joint_errors, observer, reach, rms
from pgraph_core.study.stability import in_scenario
from pgraph_core.study.task import Task
from pgraph_core.verification.hunt import FAMILIES, scenes

from .trees import random_case

pytestmark = pytest.mark.nightly
FRAMES = 21


class Subject(NamedTuple):
    model: pg.Model
    scenario: str | None
    t_end: float  # [s]


def subjects() -> dict[str, Subject]:
    """Built-in models and their scenarios, random trees, and a scene of each family."""
    found = {}
    for name in pgraph_models.names():
        model = pg.Model.load(pgraph_models.path(name))
        for scenario in (None, *(s.name for s in model.scenarios)):
            found[f"{name}, {scenario}"] = Subject(model, scenario, 0.2)
    for seed in range(10):
        case = random_case(seed, most=5)
        model, joints = case.model, pg.Mechanism(case.model).joints
        for body, joint in joints.items():  # at home a ball and a hinge of one joint may be alike
            model = model.edit(body, q=tuple(case.q[joint.q]), v=tuple(case.v[joint.v]))
        found[f"random tree {seed}"] = Subject(model, None, 0.2)
    for scene in scenes(len(FAMILIES), seed=14):
        if not scene.given:
            found[f"scene: {scene.family}"] = Subject(scene.model, None, scene.t_end)
    return found


SUBJECTS = subjects()


def tight_run(mech: pg.Mechanism, method: str, step: float, **options) -> pg.Result:
    """The same motion, tightly, by a method that was not advised; else by a tenth of the step."""
    impulses = Task(mech, None, None, np.zeros(1), options.get("scenario")).impulses
    tight = ("dop853", "dopri5") if impulses else ("dop853", "radau5", "dopri5")
    tries = [(other, {"rtol": 1e-11, "max_steps": 1_000_000}) for other in tight if other != method]
    for other, setting in [*tries, *((x, {"step": step / 10}) for x in ("rk4", "moreau_jean"))]:
        try:
            run = pg.simulate(mech, method=other, **setting, **options)
        except pg.InputError:
            continue
        if run.status.ok:
            return run
    pytest.fail("no other method reaches the end")


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_advice_of_a_map_holds(name):
    """Tried on the model as it is, or on the first value that it is for."""
    model, scenario, t_end = SUBJECTS[name]
    options = {"steps": [t_end * part for part in (0.1, 1e-2, 1e-3)], "budget": 200_000}
    try:
        found = pg.stability_map(model, scenario=scenario, t_end=t_end, **options)
    except pg.InputError:
        return
    answer = re.match(r"Take (\w+) at a step of (\S+) s", found.advice)
    if answer is None:
        assert found.advice.startswith("No method")
        return
    method, step = answer[1], float(answer[2])
    right = [c for c in found.cells if (c.method, c.status) == (method, "OK")]
    values = [c.value for c in right if f"{c.step:g}" == f"{step:g}"]
    value = found.own if found.own in values else values[0]
    model, _ = in_scenario(model, scenario)
    mech = pg.Mechanism(AXES[found.axis].applied(model, value))
    given = {"t_end": found.t_end, "frames": FRAMES, "estimate": False}
    run = pg.simulate(mech, method=method, step=step, **given)
    other = tight_run(mech, method, step, **given)
    assert joint_errors(mech, run.q, other.q).max() < 1.5 * found.target, found.advice


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_advice_of_a_report_holds(name):
    """For an error of 1e-5."""
    model, scenario, t_end = SUBJECTS[name]
    options = {"frames": FRAMES, "rounds": 1, "longest": 0.3, "target": 1e-5}
    mech = pg.Mechanism(model)
    try:
        found = pg.work_precision(mech, scenario=scenario, t_end=t_end, **options)
    except pg.InputError:
        return
    answer = re.match(r"Take (\w+) at (step|rtol) ([^ :]+)(?: s)?: error (\S+) in ", found.answer)
    if answer is None:
        assert found.answer.startswith("No method")
        return
    method, kind, number, error = answer.groups()
    given = {"t_end": found.t_end, "frames": FRAMES, "scenario": scenario, "estimate": False}
    run = pg.simulate(mech, method=method, **{kind: float(number)}, **given)
    other = tight_run(mech, method, found.t_end / max(run.counters["steps"], 1), **given)
    observe = observer(mech)
    off = float(rms(differences(observe(run.q), observe(other.q), reach(mech))))
    assert off < 2.0 * float(error.rstrip(",")) + 1e-8, found.answer

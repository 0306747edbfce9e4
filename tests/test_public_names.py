"""The public names: listed at once, loaded when used, the same for type checkers."""

from __future__ import annotations

import ast
import copy
import pickle
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

import pgraph_core as pg
import pgraph_models

SOURCE = Path(pg.__file__)


def output(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_dir_lists_every_public_name_before_any_is_used_and_nothing_else():
    names = output("import pgraph_core as pg; print(*dir(pg))").split()
    assert names == sorted(pg.__all__)
    assert not [name for name in names if name.startswith("_")]
    assert {"Model", "Body", "Mechanism", "simulate", "Result", "InputError"} <= set(names)


@pytest.mark.parametrize("name", pg.__all__)
def test_every_public_name_is_there_and_documented(name: str):
    value = getattr(pg, name)
    assert value.__doc__
    assert value.__module__.split(".")[0] == "pgraph_core"


def test_importing_star_gives_the_public_names():
    found = output("from pgraph_core import *; print(*sorted(k for k in dir() if k[0] != '_'))")
    assert found.split() == sorted(pg.__all__)


def test_type_checkers_see_the_same_names_in_the_same_modules():
    (block,) = [node for node in ast.parse(SOURCE.read_text()).body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == pg._HOME


def test_the_version_is_that_of_the_distribution():
    assert pg.__version__ == version("pgraph-dynamics")


def test_importing_loads_no_compiler_and_no_model():
    code = "import sys, pgraph_core; print(*{'numba', 'pydantic', 'numpy'} & set(sys.modules))"
    assert output(code) == ""


def test_a_misspelt_name_is_answered_with_the_closest():
    with pytest.raises(AttributeError, match="did you mean Mechanism") as caught:
        _ = pg.Mecanism
    assert "Mecanism" in str(caught.value)


def test_a_pendulum_loads_no_module_of_what_it_does_not_have():
    code = (
        "import sys, pgraph_core as pg\n"
        "model = pg.Model(bodies=[pg.Body(name='a', mass=1.0, tip=(1, 0, 0))])\n"
        "pg.simulate(model, t_end=0.01)\n"
        "print(*sorted(name for name in sys.modules if name.startswith('pgraph_core.')))"
    )
    loaded = output(code).split()
    assert "pgraph_core.simulation" in loaded
    for room in ("study", "verification", "show", "contact", "gait"):
        assert not [name for name in loaded if name.startswith(f"pgraph_core.{room}")]


MODEL = pg.Model.serial(2)
SPRING = pg.Spring(name="s", body="1", stiffness=1.0)
SCENARIO = pg.Scenario(name="s", q={"knee": 0.5})
RUN = pg.simulate(MODEL, t_end=0.01, frames=3)
SWEEP = pg.sweep(MODEL, {"bodies.2.mass": [1, 2]}, "max 2", t_end=0.01)


def spoilt(**fields):
    """A model whose first body was copied with other fields."""
    first, *others = MODEL.bodies
    return MODEL.model_copy(update={"bodies": (first.model_copy(update=fields), *others)})


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        (lambda: pg.load, "Model.load"),
        (lambda: pg.Model.load("pendulum"), "pgraph_models.path('pendulum')"),
        (lambda: MODEL.add_spring("1", "2"), "model.add(pg.Spring(name=..., ...))"),
        (lambda: MODEL.simulate(t_end=1.0), "pg.simulate(model, ...)"),
        (lambda: pg.Mechanism(MODEL).simulate(), "pg.simulate(mech, ...)"),
        (lambda: pg.simulate(MODEL, 0.5), "a duration is t_end=0.5"),
        (lambda: MODEL.edit("2", "mass", 3.0), "the others are field=value"),
        (lambda: pg.sweep(MODEL, {"2.mass": [1, 2]}, "max 2"), "write bodies.2.mass"),
        (lambda: pg.sweep("pendulum", {"a": [1]}, "max 2"), "pg.Model.load('pendulum')"),
        (lambda: SWEEP.failures, "table.failed are their numbers"),
        (lambda: SWEEP.best, "table['max knee'].argmax()"),
        (lambda: pg.Spring(name="s", body="1", k=1.0), "did you mean stiffness?"),
        (lambda: SCENARIO.q.update(knee=1), "model.edit(name of the part, field={**old"),
        (lambda: SCENARIO.q.__setitem__("knee", "zz"), "'knee': is not changed in place"),
        (lambda: MODEL["1"].model_copy(update={"masss": 1}), "did you mean mass?"),
        (lambda: MODEL.model_copy(update={"bodies": "zz"}), "bodies: must be"),
        (lambda: spoilt(mass="heavy"), "mass: must be"),
        (lambda: spoilt(mass=-5.0), "mass: "),
        (lambda: MODEL["1"].copy(update={"mass": -5.0}), "mass: "),
        (lambda: spoilt(joint="zz"), "joint: "),
        (lambda: spoilt(q=5.0, v=(1.0, 2.0)), "v: a revolute joint has 1 number"),
        (lambda: MODEL.model_copy(update={"bodies": MODEL.bodies * 2}), "name: "),
        (lambda: MODEL.model_copy(update={"gravity": "down"}), "gravity: must be"),
        (lambda: pg.Result(), "pg.simulate(...) returns it"),
        (lambda: RUN.names, "run.mechanism.names"),
        (lambda: RUN.to_dataframe(), "run.to_pandas()"),
        (lambda: RUN.energyy, "did you mean energy"),
        (lambda: getattr(RUN, "2"), "write run['2']"),
        (lambda: RUN[5:10], "frames are rows of run.q"),
        (lambda: MODEL.to_dict(), "model.to_json()"),
        (lambda: MODEL.rename("1", "2"), "model.edit(name, name='new')"),
        (lambda: getattr(MODEL, "2"), "write model['2']"),
        (lambda: MODEL["1"].edit(mass=2), "model.edit(name, field=value)"),
        (lambda: pgraph_models.load("pendulum"), "pgraph_models.path("),
        (lambda: pg.simulate("pendulum"), "pgraph_models.path('pendulum')"),
        (lambda: pg.simulate(MODEL.to_json()), "pg.Model.from_json(text)"),
        (lambda: pg.simulate(MODEL, gravity=0), "is of the model: model.replace(gravity=...)"),
        (lambda: pg.simulate(MODEL, method="RK4"), "did you mean rk4?"),
        (lambda: pg.simulate(MODEL, method="RK45"), "did you mean dopri5?"),
        (lambda: pg.Body(name="a", joint="hinge"), "did you mean revolute?"),
        (lambda: pg.Body(name="a", joint="Ball"), "did you mean spherical?"),
        (lambda: pg.Body(name="a", inertia=(1, 2, 3)), "np.diag("),
        (lambda: pg.Model(gravity=-9.81), "write (0, 0, -9.81)"),
        (lambda: pg.Model(springs=[]), "did you mean forces?"),
        (lambda: pg.Model(constraints=[SPRING]), "a Spring is a force: it goes to forces=[...]"),
        (lambda: MODEL.edit(MODEL["1"], mass=2), "give its name: '1'"),
        (lambda: pg.Mechanism(MODEL).mobility(active="loop"), "write ['loop']"),
        (lambda: pg.simulate(MODEL, tau=lambda t, q, v: None), "the function returned None"),
        (lambda: pg.Footprint(), "pg.footprints(run) returns it"),
        (lambda: len(RUN), "len(run.t) is the number of frames"),
        (lambda: RUN[0], "frames are rows of run.q"),
        (lambda: list(RUN), "run.to_pandas() is a table"),
        (lambda: __import__("pandas").DataFrame(RUN), "run.to_pandas() is a table"),
        (lambda: RUN["q"], "run.q"),
        (lambda: pg.Mechanism(MODEL).assemble(hold="1"), "choose from q, v, active"),
        (lambda: pg.Stepper(MODEL).step(lambda t, q, v: v), "pg.Stepper(..., tau=function)"),
        (lambda: pg.Stepper(MODEL).step({"1": 1.0}), "tau: must be numbers"),
        (lambda: pg.BatchStepper(MODEL, 2).step({"1": 1.0}), "numbers of shape (2, 2) or (2,)"),
    ],
)
def test_what_people_type_from_memory_is_answered_with_what_to_write(typed, told):
    with pytest.raises((pg.PgraphError, AttributeError)) as refused:
        typed()
    assert told in str(refused.value)


def test_a_validated_copy_of_a_body_moves_as_its_fields_say():
    arm = pg.Body(name="arm", com=(0.2, 0, 0), axes=(0, 1, 0), q=0.1, stiffness=2.0)
    turned = arm.model_copy(update={"axes": ((1, 0, 0),)})
    assert turned == pg.Body(name="arm", com=(0.2, 0, 0), axes=(1, 0, 0), q=0.1, stiffness=2.0)
    slides = arm.model_copy(update={"joint": "prismatic"})
    assert slides == pg.Body(name="arm", com=(0.2, 0, 0), joint="prismatic")
    assert pg.Mechanism(pg.Model(bodies=(slides,))).joints["arm"].kinds == (1,)
    solid = pg.Body(
        name="b", shape=pg.Shape(kind="sphere", radius=0.1), derived=("mass",), density=1000.0
    )
    assert solid.model_copy(update={"density": 2000.0}).mass == pytest.approx(2 * solid.mass)
    assert solid.model_copy(update={"shape": None, "derived": (), "density": None}).shapes == ()


def test_a_part_by_its_name_in_brackets():
    assert MODEL["2"] is MODEL.body("2")
    assert not hasattr(MODEL, "nothing_of_the_kind")


def test_a_copy_and_a_pickle_of_a_part_keep_its_dictionaries_fixed():
    for other in (copy.deepcopy(SCENARIO), pickle.loads(pickle.dumps(SCENARIO))):
        assert other == SCENARIO
        with pytest.raises(pg.ModelError):
            other.q["knee"] = 1.0
    assert {**SCENARIO.q, "hip": (1.0,)} == {"knee": (0.5,), "hip": (1.0,)}

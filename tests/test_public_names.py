"""The public names: listed at once, loaded when used, the same for type checkers."""

import ast
import copy
import inspect
import pickle
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_core.engine import layout as at
from pgraph_core.errors import example_of

MODEL = pg.Model.serial(2)
SCENARIO = pg.Scenario(name="s", q={"knee": 0.5})


def test_importing_lists_every_public_name_and_loads_no_compiler_and_no_model():
    code = (
        "import sys, pgraph_core as pg\n"
        "print(*dir(pg))\n"
        "print(*{'numba', 'pydantic', 'numpy'} & set(sys.modules))\n"
        "from pgraph_core import *\n"
        "print(*sorted(k for k in dir() if k[0] != '_' and k not in ('sys', 'pg')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    listed, loaded, star = done.stdout.splitlines()
    assert listed.split() == star.split() == sorted(pg.__all__)
    assert loaded == ""


def test_every_public_name_is_there_and_documented():
    for name in pg.__all__:
        value = getattr(pg, name)
        assert value.__doc__, name
        assert value.__module__.split(".")[0] == "pgraph_core", name


def test_the_reference_lists_every_public_name():
    text = (Path(__file__).parent.parent / "docs" / "api.md").read_text()
    assert {*re.findall(r"^\.\. auto\w+:: (\w+)$", text, re.MULTILINE)} == {*pg.__all__}


def test_calls_with_a_mapping_or_a_function_have_an_example():
    """Refusals of their arguments end with it, because a type does not say what to write."""
    methods = (pg.Mechanism.inverse_kinematics, pg.Model.edit_all, pg.Result.gradient)
    functions = [x for name in pg.__all__ if inspect.isfunction(x := getattr(pg, name))]
    for function in (*functions, *methods):
        parameters = inspect.signature(function).parameters.values()
        kinds = [str(p.annotation) for p in parameters if p.default is p.empty]
        if any("Mapping" in kind or "Callable" in kind for kind in kinds):
            assert f"{function.__name__}(" in example_of(function), function


def test_type_checkers_see_the_same_names_in_the_same_modules():
    tree = ast.parse(Path(pg.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == pg._HOME


def test_a_validated_copy_of_a_body_moves_as_its_fields_say():
    arm = pg.Body(name="arm", com=(0.2, 0, 0), axes=(0, 1, 0), q=0.1, stiffness=2.0)
    turned = arm.model_copy(update={"axes": ((1, 0, 0),)})
    assert turned == pg.Body(name="arm", com=(0.2, 0, 0), axes=(1, 0, 0), q=0.1, stiffness=2.0)
    slides = arm.model_copy(update={"joint": "prismatic"})
    assert slides == pg.Body(name="arm", com=(0.2, 0, 0), joint="prismatic")
    assert pg.Mechanism(pg.Model(bodies=(slides,))).joints["arm"].kinds == (at.TRANSLATE,)
    solid = pg.Body(
        name="b", shape=pg.Shape(kind="sphere", radius=0.1), derived=("mass",), density=1000.0
    )
    assert solid.model_copy(update={"density": 2000.0}).mass == pytest.approx(2 * solid.mass)
    assert solid.model_copy(update={"shape": None, "derived": (), "density": None}).shapes == ()


def test_a_part_is_found_by_its_name_in_brackets():
    assert MODEL["2"] is MODEL.body("2")
    assert not hasattr(MODEL, "nothing_of_the_kind")


def test_a_copy_and_a_pickle_of_a_part_keep_its_dictionaries_fixed():
    for other in (copy.deepcopy(SCENARIO), pickle.loads(pickle.dumps(SCENARIO))):
        assert other == SCENARIO
        with pytest.raises(pg.ModelError):
            other.q["knee"] = 1.0
    assert {**SCENARIO.q, "hip": (1.0,)} == {"knee": (0.5,), "hip": (1.0,)}

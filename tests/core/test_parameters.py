"""Named parameters: one number for many cells, in files and through every edit."""

import contextlib
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.model.parameters import evaluated

NAMES = {"a": 2.0, "thigh": 0.22, "n": -3.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("=thigh", 0.22),
        ("=-(a + n)*3", 3.0),
        ("=a**3 - 1e-3", 7.999),
        ("=sqrt(a*2) + max(1, 2, a)", 4.0),
        ("=30*pi/180", math.pi / 6),
    ],
)
def test_a_formula_has_the_value_of_its_arithmetic(text, value):
    assert evaluated(text, NAMES) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("=thig", "'thig'; did you mean thigh"),
        ("=True", "'True'"),
        ("=1/(a-2)", "divides by zero"),
        ("=9**9**9**9", "too large"),
        ("=n**0.5", "finite"),
        ("=sqrt()", "one argument"),
        ("=sqrt(-1)", "no value"),
        ("=" + "1+" * 5000 + "1", "200 characters"),
        *(
            (text, "formula")
            for text in (
                "=", "=a b", "=__import__('os').system('ls')", "=a.real", "=[1][0]",
                "=" + "(" * 190, "=\0",
            )
        ),
    ],
)  # fmt: skip
def test_a_text_that_is_no_formula_is_refused(text, fact):
    with pytest.raises(ValueError, match=re.escape(fact)):
        evaluated(text, NAMES)


@given(st.text(max_size=60))
def test_any_text_is_a_number_or_refused_with_a_reason(text):
    with contextlib.suppress(ValueError):
        assert math.isfinite(evaluated(f"={text}", NAMES))


@pytest.fixture
def legs():
    chain = pg.Model.serial(3).replace(parameters={"thigh": 0.22, "heavy": 2.0})
    chain = chain.edit("1", tip=("=thigh", 0.0, 0.0), mass="=heavy")
    return chain.edit("2", link=("=thigh", 0, 0), com=("=thigh/2", 0, 0), damping="=heavy/100")


def test_one_parameter_changes_every_cell_that_uses_it(legs):
    longer = legs.replace(parameters={**legs.parameters, "thigh": 0.3})
    assert longer.body("1").tip == (0.3, 0, 0)
    assert longer.body("2").link == (0.3, 0, 0)
    assert longer.body("2").com == (0.15, 0, 0)
    assert longer.body("2").damping == (0.02,)
    assert legs.body("1").tip == (0.22, 0, 0)  # the old one is the undo step


def test_a_file_holds_the_formulas_in_their_cells(legs):
    text = legs.to_json()
    assert '"link": ["=thigh", 0.0, 0.0]' in text
    assert '"damping": "=heavy/100"' in text
    assert '"schema_version": 2' in text
    again = pg.Model.from_json(text)
    assert again == legs
    assert again.to_json() == text
    plain = pg.Model.serial(2).to_json()
    assert '"schema_version": 1' in plain
    assert "parameters" not in plain
    assert "formulas" not in plain


def test_a_cell_that_gets_a_number_loses_its_formula(legs):
    edited = legs.edit("2", link=(0.5, 0, 0))
    assert {(f.name, f.path[0]) for f in edited.formulas} == {
        ("1", "tip"), ("1", "mass"), ("2", "com"), ("2", "damping"),
    }  # fmt: skip
    assert edited.replace(parameters={**legs.parameters, "thigh": 1.0}).body("2").link[0] == 0.5


def test_formulas_follow_a_new_name_and_go_with_their_body(legs):
    renamed = legs.edit("2", name="shank")
    assert {f.name for f in renamed.formulas} == {"1", "shank"}
    assert pg.Model.from_json(renamed.to_json()) == renamed
    assert {f.name for f in legs.remove("2").formulas} == {"1"}
    assert {f.path[0] for f in legs.edit("2", dof=0).formulas} == {"tip", "mass", "link", "com"}


def test_copies_and_several_edits_share_the_parameter(legs):
    twins = legs.duplicate("2")
    assert twins.replace(parameters={**legs.parameters, "thigh": 0.5}).body("4").link[0] == 0.5
    every = legs.edit_all({name: {"com": ("=-thigh", 0, 0)} for name in ("1", "2")})
    assert every.body("1").com == every.body("2").com == (-0.22, 0, 0)
    assert sum(f.path[0] == "com" for f in every.formulas) == 2
    swapped = legs.edit_all({"1": {"name": "2"}, "2": {"name": "1"}})
    assert {(f.name, f.path[0]) for f in swapped.formulas} >= {("2", "tip"), ("1", "link")}


def test_a_formula_of_the_same_value_is_still_an_edit(legs):
    edited = legs.edit("3", link=("=0.2", 0, 0))
    assert edited is not legs
    assert edited.body("3") == legs.body("3")
    assert edited.edit("3", link=("=0.2", 0, 0)) is edited


@pytest.mark.parametrize("more", [{}, {"colour": (1, 0, 0)}, {"opacity": "=r"}])
@pytest.mark.parametrize("count", [1, 2])
def test_a_formula_in_the_first_of_any_shapes_is_in_the_file(more, count):
    shapes = [{"kind": "sphere", "radius": "=r", **more}, {"kind": "sphere", "radius": 1.0}]
    body = {"name": "a", "shapes": shapes[:count]}
    model = pg.Model(bodies=[body], parameters={"r": 0.3})
    assert ("shape", "radius") in [f.path for f in model.formulas]
    again = pg.Model.from_json(model.to_json())
    assert again == model
    assert again.replace(parameters={"r": 0.7}).body("a").shapes[0].radius == 0.7
    assert again.edit("a", mass=2.0).formulas == model.formulas


def test_formulas_in_constraints_shapes_and_forces():
    model = pg.Model.from_json(
        """{"parameters": {"r": 0.1}, "bodies": [{"name": "a", "joint": "free",
        "shape": {"kind": "sphere", "radius": "=r"}}], "constraints": [{"name": "rope", "body": "a",
        "kind": "distance", "length": "=10*r", "other_point": [0, 0, "=r"]}], "forces": [{"name":
        "push", "kind": "wrench", "body": "a", "force": ["=r", 0, 0]}]}"""
    )
    bigger = model.replace(parameters={"r": 0.2})
    assert bigger.body("a").shape.radius == 0.2
    assert bigger.constraints[0].length == 2.0
    assert bigger.constraints[0].other_point == (0, 0, 0.2)
    assert bigger.forces[0].force == (0.2, 0, 0)
    assert pg.Model.from_json(bigger.to_json()) == bigger
    assert bigger.cells(bigger.constraints[0], "constraints")["length"] == "=10*r"


def test_a_parameter_in_use_cannot_go(legs):
    with pytest.raises(pg.ModelError, match="'thigh'"):
        legs.replace(parameters={"heavy": 1.0})


TIED = """{"parameters": {"r": 0.1, "side": 0.07, "none": 0.0, "k": 50.0}, "bodies": [
    {"name": "trunk", "joint": "free"},
    {"name": "left_hip", "parent": "trunk", "joint": "spherical",
     "link": ["=r", "=none", "=-(side)"], "com": [0.0, "=-side/2", "=side"], "q": [1, 0, 0, 0],
     "inertia": [[0.02, "=r/100", 0], ["=r/100", 0.02, 0], [0, 0, 0.02]],
     "shape": {"kind": "box", "size": ["=r", 0.1, 0.1],
     "position": [0, 0, "=side"]}},
    {"name": "left_knee", "parent": "left_hip", "q": ["=side"],
     "v": "=none", "stiffness": "=k"}],
  "constraints": [
    {"name": "left rope", "body": "left_knee", "other": "trunk", "kind": "distance",
     "length": "=4*r", "point": [0, "=r", "=none"], "other_point": ["=side", 0, "=side"]},
    {"name": "left row", "body": "left_knee", "kind": "velocity", "value": "=r",
     "coefficients": {"left_knee": ["=k"]}}],
  "contacts": [{"name": "left sole", "body": "left_knee", "points": [[0, 0, "=side"]],
     "friction": "=k/100"}],
  "forces": [
    {"name": "left push", "kind": "wrench", "body": "left_knee", "frame": "body",
     "force": ["=k", 0, "=k"], "torque": ["=r", 0, "=-r"], "point": [0, 0, "=none"]},
    {"name": "left drive", "kind": "servo", "body": "left_knee", "kp": "=k", "target": "=side"}]}"""


@pytest.mark.parametrize("copy", ["x", "y", "z", None])
def test_to_copy_and_to_change_a_parameter_commute(copy):
    """A formula of a copy has the sign of its cell's reflection, also where it is zero now."""
    model = pg.Model.from_json(TIED)
    other = {"r": 0.25, "side": -0.03, "none": 0.4, "k": 80.0}

    def copied(model: pg.Model) -> pg.Model:
        return model.duplicate("left_hip") if copy is None else model.mirror("left_hip", copy)

    twins = copied(model)
    assert len(twins.formulas) == 2 * len(model.formulas)
    assert pg.Model.from_json(twins.to_json()) == twins
    changed, expected = twins.replace(parameters=other), copied(model.replace(parameters=other))
    assert changed.formulas == expected.formulas
    assert changed == expected

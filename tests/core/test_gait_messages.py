"""What gaits that cannot be walked are answered with, word for word."""

from __future__ import annotations

from typing import Any

import pytest

import pgraph_core as pg
import pgraph_models

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")
QUADRUPED = pg.Model.load(pgraph_models.path("quadruped_hips"))
TROT = pg.gaits()["trot"]


def falls(**changes: Any) -> list[dict[str, Any]]:
    return [{"foot": foot, "offset": 0.0, "duty": 0.5} | changes for foot in FEET]


BY_ITSELF: list[tuple[dict[str, Any], str]] = [
    (
        {"feet": falls(offset=1.0)},
        "gait 'g', feet: offset must be a number from 0 to below 1: the part of the stride at "
        "which it touches down; given 1.0",
    ),
    (
        {"feet": falls(duty=0.0)},
        "gait 'g', feet: duty must be a number above 0, at most 1: the part of the stride that it "
        "is on the ground; given 0.0",
    ),
    (
        {"feet": falls()[:3]},
        "gait 'g', feet: must be four; given " + repr(list(FEET[:3])),
    ),
    ({"feet": falls(foot="a")}, "gait 'g', feet: 'a' stands there twice"),
    (
        {"feet": falls(), "sway": (0.1,)},
        "gait 'g', sway: must be pairs of numbers, 4 at most; given [0.1]",
    ),
    (
        {"feet": falls(), "stride": 0},
        "gait 'g', stride: must be the time of a stride > 0 [s]; given 0",
    ),
    (
        {"feet": falls(), "gains": {"roll": (1, -1)}},
        "gait 'g', gains: roll must be two numbers >= 0 [1/s^2, 1/s]; given -1",
    ),
]


@pytest.mark.parametrize(("fields", "said"), BY_ITSELF)
def test_a_gait_by_itself(fields: dict[str, Any], said: str):
    with pytest.raises(pg.ModelError) as refused:
        pg.Gait(name="g", **fields)
    assert said in str(refused.value).splitlines()


def test_a_scenario_whose_gait_names_other_feet():
    gait = TROT.edit(feet=[f.model_dump() | {"foot": f"{f.foot}!"} for f in TROT.feet])
    scenario = pg.Scenario(name="walk", gait=gait)
    with pytest.raises(pg.ModelError) as refused:
        QUADRUPED.replace(scenarios=(scenario,))
    assert str(refused.value.problems[0]) == (
        "scenario 'walk', gait: no contact is named 'left_front_foot!'; choose one of "
        + ", ".join(FEET)
    )


def refusal(model: pg.Model, gait: pg.Gait) -> str:
    with pytest.raises(pg.InputError) as refused:
        pg.Controller(pg.Mechanism(model), gait)
    return str(refused.value)


def test_models_that_cannot_walk():
    bare = QUADRUPED.replace(contacts=(), scenarios=())
    said = "gait 'trot': no contact is named 'left_front_foot'; the model has no contact"
    assert refusal(bare, TROT) == said
    assert refusal(pg.Model.serial(3), TROT) == (
        "gait 'trot': walks where up is 'y' and legs swing about z; up is 'z'"
    )
    held = QUADRUPED.replace(scenarios=()).edit("pelvis", joint="weld")
    said = "gait 'trot': needs a trunk that is free; the joint of 'pelvis' is not"
    assert refusal(held, TROT) == said
    stiff = QUADRUPED.replace(scenarios=()).edit("left_radius", joint="weld")
    assert refusal(stiff, TROT) == (
        "gait 'trot': a leg has three hinges about z, the hip's after one about x or alone; that "
        "of 'left_front_foot' has not"
    )


def test_a_speed_or_height_that_the_legs_cannot_reach():
    said = refusal(QUADRUPED, TROT.edit(speed=9.0))
    assert said.startswith("gait 'trot', speed: 9 m/s is more than '")
    assert said.endswith("a shorter stride or duty allows more than 0.38 s and 0.5 do")
    said = refusal(QUADRUPED, TROT.edit(height=0.7))
    assert said.startswith("gait 'trot', height: 0.7 m puts a hip at ")


def test_an_edit_that_takes_a_foot_takes_the_gait():
    lame = QUADRUPED.remove("left_hind_paw")
    assert all(s.gait is None for s in lame.scenarios)
    assert "scenario 'trot': its gait went with a foot" in lame.notices

"""The form of a muscle: its excitation over time, its model, and the numbers of its curves."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints.view import between, constraints, form
from pgraph_app.core.cells import Display
from pgraph_app.scene import marks

from .store import ME, after, begun, do, reply

BODIES = (
    pg.Body(name="upper", joint="weld"),
    pg.Body(name="forearm", parent="upper", link=(0, 0, -0.3), mass=1.0, com=(0, 0, -0.15)),
)


def led():
    """The state after a muscle was led from a body to another."""
    state = begun(pg.Model(bodies=BODIES))
    return after(state, do.AddPart(ME, "forces", "muscle", "forearm"), do.PickName(ME, "upper"))


def edited(state, field, text):
    (muscle,) = state.model.forces
    return after(state, do.EditPart(ME, 1, "forces", muscle.name, field, (((), text),)))


def fields(state):
    for one in constraints(state, state.clients[ME])["lists"]:
        for item in one["items"]:
            return {f["field"]: f for group in item["form"] for f in group["fields"]}


def test_a_new_muscle_pulls_from_the_first_body_to_the_other():
    (muscle,) = led().model.forces
    assert (muscle.kind, muscle.body, muscle.other) == ("muscle", "forearm", "upper")


def test_a_new_muscle_fits_between_its_ends():
    (muscle,) = led().model.forces
    run = pg.simulate(led().model.edit("forearm", inertia=(0.01, 0.01, 0.01)), t_end=0.01)
    assert muscle.l_opt + muscle.l_slack == pytest.approx(run.path_length[muscle.name][0], rel=5e-3)
    assert run.tension[muscle.name][0] < 0.05 * muscle.f_max


def test_an_excitation_is_a_number_a_table_or_an_expression():
    for text, value in (
        ("0.4", 0.4),
        ("0 0; 1 0.5", pg.Table(t=(0, 1), value=(0, 0.5))),
        ("=0.5 + 0.5*sin(t)", "=0.5 + 0.5*sin(t)"),
    ):
        assert edited(led(), "excitation", text).model.forces[0].excitation == value
    state = edited(led(), "excitation", "2")
    assert "from 0 to 1" in reply(state)
    assert state.model.forces[0].excitation == 0.0


def test_the_shape_is_typed_by_names():
    state = edited(led(), "model", "thelen2003")
    assert state.model.forces[0].model == "thelen2003"
    state = edited(state, "shape", "tendon_strain 0.033; active_width = 0.5")
    assert state.model.forces[0].shape == {"tendon_strain": 0.033, "active_width": 0.5}
    shown = fields(state)["shape"]
    assert shown["cells"][0]["value"] == "tendon_strain 0.033; active_width 0.5"
    assert "passive_shape 5" in shown["note"]
    assert "tendon_strain" in reply(edited(state, "shape", "tendon_strian 0.03"))
    assert not edited(state, "shape", "").model.forces[0].shape


def test_a_muscle_is_drawn_with_the_colour_of_its_excitation():
    state = edited(led(), "excitation", "1")
    drawn = marks.joinings(state, np.zeros((2, 3)), np.array([np.eye(3)] * 2))["muscles"]
    assert len(drawn.at) == 1
    np.testing.assert_array_equal(drawn.colors, [marks.ACTIVE])
    rest = edited(led(), "excitation", "0")
    drawn = marks.joinings(rest, np.zeros((2, 3)), np.array([np.eye(3)] * 2))["muscles"]
    np.testing.assert_array_equal(drawn.colors, [marks.AT_REST])


def test_a_line_of_the_list_names_a_body_once_for_points_that_follow_each_other_on_it():
    ways = {
        ("upper", "upper", "forearm"): "upper, forearm",
        ("forearm", "upper", "forearm"): "upper, forearm, upper, forearm",
        (): "upper, forearm",
    }
    for passed, text in ways.items():
        via = [{"body": name, "point": (0.0, 0.01, -0.1)} for name in passed]
        muscle = pg.Muscle(body="upper", other="forearm", via=via, f_max=1.0, l_opt=0.1,
                           l_slack=0.1)  # fmt: skip
        assert between(muscle) == text


def test_a_form_of_a_muscle_begins_with_its_excitation_and_ends_with_its_path():
    """Numbers that are those of the model are among "More" until they are given."""

    def groups(state):
        (muscle,) = state.model.forces
        drawn = form(state, Display(), "forces", muscle)
        return {g["title"]: list(dict.fromkeys(f["field"] for f in g["fields"])) for g in drawn}

    first = ["name", "kind", "body", "other", "excitation", "f_max", "l_opt", "l_slack",
             "pennation", "model", "tendon"]  # fmt: skip
    seldom = ["start", "rise", "fall", "fastest", "damping", "weakest", "shape"]
    assert groups(led()) == {"": first, "More": seldom, "Path": ["point", "via", "other_point"]}
    given = groups(edited(led(), "rise", "0.02"))
    assert (given[""], given["More"]) == ([*first, "rise"], [n for n in seldom if n != "rise"])


def test_a_choice_that_may_be_left_out_can_be_taken_back():
    """The list of the tendon was empty until one of both was chosen, for ever."""
    state = edited(led(), "tendon", "rigid")
    assert state.model.forces[0].tendon == "rigid"
    shown = fields(state)["tendon"]
    assert [value for value, _ in shown["options"]] == ["", "elastic", "rigid"]
    assert edited(state, "tendon", "").model.forces[0].tendon is None
    assert "model" in reply(edited(state, "model", ""))

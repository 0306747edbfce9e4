"""The form of a muscle: its excitation over time, its model, and the numbers of its curves."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints.view import between, constraints, form
from pgraph_app.core.cells import Display
from pgraph_app.scene import ties

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
    drawn = ties.joinings(state, np.zeros((2, 3)), np.array([np.eye(3)] * 2))["muscles"]
    assert len(drawn.at) == 1
    np.testing.assert_array_equal(drawn.colors, [ties.ACTIVE])
    rest = edited(led(), "excitation", "0")
    drawn = ties.joinings(rest, np.zeros((2, 3)), np.array([np.eye(3)] * 2))["muscles"]
    np.testing.assert_array_equal(drawn.colors, [ties.AT_REST])


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


def curves(state):
    """Return the pictures of a path by their labels."""
    (item,) = (
        one for one in constraints(state, state.clients[ME])["lists"][2]["items"] if one["form"]
    )
    groups = {one["title"]: one for one in item["form"]}
    found = groups.get("Length and moment arm", {"fields": []})
    return {f["label"]: f["curve"] for f in found["fields"] if "curve" in f}


def with_path(**fields):
    """A muscle past two hinges, with a point that counts in a range of the first one."""
    links = [
        pg.Body(name=name, parent=parent, link=link, mass=1, inertia=(1, 1, 1), limits=((-1, 1),))
        for name, parent, link in (
            ("arm", "ground", (0, 0, 0)), ("hand", "arm", (0.3, 0, 0)), ("aside", "arm", (0, 0, 1))
        )
    ]  # fmt: skip
    given = {"f_max": 100, "l_opt": 0.2, "l_slack": 0.1, "point": (0.1, 0.05, 0)}
    muscle = pg.Muscle(name="m", body="hand", other_point=(-0.1, 0.1, 0), **{**given, **fields})
    return after(begun(pg.Model(bodies=links, forces=[muscle])), do.OpenPart(ME, "forces", "m"))


def test_the_pictures_show_the_length_and_its_slope_over_each_joint_that_moves_it():
    found = curves(with_path())
    assert list(found) == ["Over arm", "Over hand"]
    for picture in found.values():
        length, arm = picture["lines"]
        x, y = np.array(length["t"]), np.array(length["y"])
        assert (x[0], x[-1]) == (-1.0, 1.0)
        slope = np.gradient(y, x)[1:-1]
        np.testing.assert_allclose(arm["y"][1:-1], -slope, rtol=0, atol=1e-3 * np.ptp(y))
        assert length["dots"] is None


def test_a_jump_of_a_length_is_marked_in_its_picture():
    ranged = pg.Via(
        body="arm", point=(0.1, 0.3, 0), when=pg.Within(body="hand", low=-0.5, high=4.0)
    )
    found = curves(with_path(via=[ranged]))
    length, _ = found["Over hand"]["lines"]
    assert length["dots"]["t"] == [-0.5]
    assert found["Over arm"]["lines"][0]["dots"] is None


def test_a_path_of_constant_length_has_no_picture():
    assert not curves(with_path(via=[("hand", (0.1, 0, 0))], other="hand", shifts=[
        pg.Shift(body="aside", along=(1, 0, 0), curve=pg.Polynomial(coefficients=(0.1,)))
    ]))  # fmt: skip

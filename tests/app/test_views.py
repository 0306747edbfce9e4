"""Payloads of the views are plain JSON, with and without a run."""

import json
import math
from functools import partial

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import MobilityReport
from pgraph_app.digraph.view import digraph
from pgraph_app.features import places
from pgraph_app.model.view import toolbar
from pgraph_app.playback.view import playback
from pgraph_app.properties.view import properties
from pgraph_app.run import Request, Run
from pgraph_app.run.view import Measure, differences, run
from pgraph_app.table.view import table

from .store import ME, after, begun, built_in, do, ran

pytestmark = pytest.mark.quick


@pytest.fixture(scope="module")
def state():
    return begun(built_in("quadruped"))


@pytest.fixture(scope="module")
def stood(state):
    return ran(state, pg.simulate(pg.Mechanism(state.model), scenario="stance", t_end=0.01))


@pytest.mark.parametrize("view", [table, digraph, playback, partial(toolbar, client=ME), run])
def test_payloads_are_json(state, stood, view):
    for one in (state, stood):
        assert json.loads(json.dumps(view(one), allow_nan=False))


def test_the_summary_says_how_a_run_ended_how_well_and_at_what_cost(stood):
    lines = {what for what, *_ in run(stood)["summary"]}
    expected = {"Energy drift", "Constraint drift", "Cost", "Method"}
    assert expected <= lines


def test_two_runs_are_compared_in_numbers():
    ball = pg.Body(
        name="ball", mass=2.0, joint="free", v=(0, 0, 0, 3.0, 0, 4.0), inertia=(0.01,) * 3
    )
    model = pg.Model(bodies=(ball,), gravity=(0, 0, 0), up="z")
    long, short = (pg.simulate(model, t_end=t_end, step=0.1) for t_end in (2.0, 1.0))
    state = ran(begun(model), long)
    assert not run(state)["compared"]["rows"]
    state = ran(after(state, do.KeepRun(ME)), short)
    lines = {what: tuple(values) for what, *values in run(state)["compared"]["rows"]}
    # 4 m/s along the vertical are no distance
    assert lines["distance [m]"] == ("6", "3", "−3")
    assert lines["mean speed [m/s]"] == ("3", "3", "0")
    assert lines["duration [s]"] == ("2", "1", "−1")


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [(0.1575, 0.1, "0.2"), (-20.2381, 0.13, "-20.2"), (5.6034, 2e-3, "5.603"),
     (5.6034, 0.0, "5.603"), (5.6034, math.nan, "5.603"), (123.4, 30.0, "120")],
)  # fmt: skip
def test_a_figure_has_the_digits_that_its_error_supports(value, error, shown):
    assert str(Measure(value, "m", error)) == shown
    other = Measure(value if math.isnan(error) else value + error / 10, "m", error)
    assert Measure(value, "m", error).since(other) in ("0", "< error")


def compared(first, second, **settings):
    """The differences between a kept run of a model and a run of another with other settings."""
    rows = differences(
        [Run(model, Request(**given), None) for model, given in ((first, {}), (second, settings))]
    )
    return {what: tuple(values) for what, *values in rows}


def test_runs_that_are_compared_say_what_was_changed_between_them():
    model = pg.Model.serial(3).add(pg.Spring(name="s", body="1", other="3", stiffness=5.0))
    assert compared(model, model) == compared(model, pg.Model.from_json(model.to_json())) == {}
    heavier = model.edit("2", mass=2.5).edit("s", stiffness=50.0).replace(gravity=(0, 0, -1.62))
    before = model.body("2").mass
    assert compared(model, heavier) == {
        "gravity [m/s²]": ("0, 0, -9.81", "0, 0, -1.62"),
        "2: mass [kg]": (f"{before:.4g}", "2.5"),
        "s: stiffness [N/m]": ("5", "50"),
    }
    assert compared(model, model, step=0.01)["step"] == ("auto", "0.01 s")
    assert compared(model, model.remove("3"))["s"] == ("spring", "none")
    every = model.edit_all({body.name: {"mass": 9.0, "com": (1, 2, 3)} for body in model.bodies})
    lines = compared(pg.Model.serial(20), pg.Model.serial(20).edit_all(
        {str(k): {"mass": 7.0} for k in range(1, 21)}
    ))  # fmt: skip
    assert len(lines) < 20
    assert any("more" in what for what in lines)
    assert compared(model, every)["1: mass [kg]"][1] == "9"


@pytest.mark.parametrize("joint", pg.Body.model_fields["joint"].annotation.__args__)
def test_every_kind_of_joint_has_all_its_numbers_in_cells(joint):
    track = {"track": pg.Track(points=[(0, 0, 0), (1, 0, 0)])} if joint == "curve" else {}
    state = begun(pg.Model.serial(2).edit("2", joint=joint, **track))
    body, sent = state.model.body("2"), {}
    for group in properties(state, ("2",))["groups"]:
        for field in group["fields"]:
            sent.setdefault(field["field"], []).extend(cell["value"] for cell in field["cells"])
    for name in ("link", "rotation", "com", "inertia", "q", "v", "damping"):
        assert sent.get(name, []) == np.ravel(getattr(body, name)).tolist()


def test_an_axis_along_one_of_the_frame_is_one_cell_that_takes_any_direction():
    def axis(state):
        groups = properties(state, ("1",))["groups"]
        fields = [field for group in groups for field in group["fields"]]
        return [c["value"] for field in fields if field["field"] == "axes" for c in field["cells"]]

    state = begun(pg.Model.serial(2).edit("1", axes=(0, -1, 0)))
    assert axis(state) == ["-y"]
    for text, value, shown in (
        ("Z", (0.0, 0.0, 1.0), ["z"]), ("-x", (-1.0, 0.0, 0.0), ["-x"]),
        ("[0, 0.6, 0.8]", (0.0, 0.6, 0.8), [0.0, 0.6, 0.8]),
    ):  # fmt: skip
        after_ = after(state, do.EditBodies(ME, 1, ("1",), "axes", (((0,), text),)))
        assert after_.model.body("1").axes == (value,)
        assert axis(after_) == shown
    for text in ("w", "1 2", ""):
        refused = after(state, do.EditBodies(ME, 1, ("1",), "axes", (((0,), text),)))
        assert refused.model is state.model
        assert refused.clients[ME].reply.text


def test_nobody_selected_gives_the_model(state):
    assert properties(state, ())["bodies"] == []
    assert properties(state, ("gone",))["bodies"] == []


def test_the_fourth_column_is_the_type_of_constraint():
    """Sec. 4.1: holonomic is the joint alone; the list of constraints changes the column."""
    assert {row["constraint"] for row in table(begun(pg.Model.serial(3)))["rows"]} == {"holonomic"}
    quadruped = {row["name"]: row for row in table(begun(built_in("quadruped")))["rows"]}
    for name, row in quadruped.items():  # a paw touches the ground, and is held in stance
        assert row["constraint"] == ("point, contact" if name.endswith("paw") else "contact")
    rows = table(begun(built_in("four_bar")))["rows"]
    loop = built_in("four_bar").constraints[0]
    assert [row["constraint"] == loop.kind for row in rows] == [row["tied"] for row in rows]
    assert sum(row["tied"] for row in rows) == 2
    assert table(begun(built_in("rolling_disc")))["rows"][-1]["constraint"] == "rolling"
    ball = pg.Body(name="ball", joint="free", shape=pg.Shape(kind="sphere", radius=0.1))
    arm = pg.Body(name="arm", limits=((-1, 1),), shape=ball.shape)
    held = pg.Model(
        bodies=(ball, arm),
        contacts=[pg.Contact(name="a", body="ball"), pg.Contact(body="arm")],
    )
    rows = table(begun(held))["rows"]
    assert [row["constraint"] for row in rows] == ["contact", "contact, limits"]
    assert rows[0]["constraints"] == ("a",)


def test_the_degrees_of_freedom_left_are_told_once_they_are_known():
    state = begun(built_in("four_bar"))
    assert toolbar(state, ME)["count"].startswith("… DoF (3 in tree)")
    known = after(state, do.Learned(MobilityReport.about(state.model)))
    assert "1 DoF (3 in tree)" in toolbar(known, ME)["count"]
    edited = after(known, do.EditBodies(ME, 1, (state.derived.names[0],), "mass", (((), "7"),)))
    assert toolbar(edited, ME)["count"].startswith("… DoF (3 in tree)")


def test_a_model_without_bodies_cannot_be_run(state):
    for one, empty in ((begun(pg.Model(bodies=())), True), (state, False)):
        assert run(one)["empty"] == empty
        assert bool(run(one)["trust"]["why"]) != empty


def test_an_answer_to_a_cell_is_drawn_after_the_value_that_it_is_about():
    in_order = sorted(places(), key=lambda place: place.order)
    topics = [place.make.args[0] for place in in_order if isinstance(place.make, partial)]
    values = ("table", "properties", "constraints", "scenario", "run", "search", "reports")
    assert topics.index("reply") > max(map(topics.index, values))

"""Words of calls: parts of a free joint by name, paths in edits, and points."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names

BALL = pg.Body("b", joint="free", inertia=(1.0, 2.0, 2.5), v=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
MODEL = pg.Model([BALL, pg.Body("arm", axes=(0, 1, 0), inertia=(1, 1, 1))], gravity=(0, 0, 0))
PARTS = {"angular": (1.0, 2.0, 3.0), "linear": (4.0, 5.0, 6.0)}


@pytest.mark.parametrize("names", [("angular",), ("linear",), ("angular", "linear")])
def test_the_velocity_of_a_free_joint_is_given_by_the_names_of_its_parts(names):
    """Parts that are not given keep the values of the model."""
    given = {name: PARTS[name] for name in names}
    expected = [*(given.get("angular", BALL.v[:3])), *(given.get("linear", BALL.v[3:]))]
    mech, stepper = pg.Mechanism(MODEL), pg.Stepper(MODEL)
    run = pg.simulate(MODEL, v={"b": given}, t_end=0.01)
    np.testing.assert_array_equal(run.v[0][mech.joints["b"].v], expected)
    stepper.reset(v={"b": given})
    np.testing.assert_array_equal(np.asarray(stepper.v)[mech.joints["b"].v], expected)
    whole = {name: PARTS[name] for name in ("angular", "linear")}
    assert pg.Body("b", joint="free", v=whole).v == (1, 2, 3, 4, 5, 6)
    assert MODEL.edit("b", v=whole).body("b").v == (1, 2, 3, 4, 5, 6)


def test_positions_accelerations_and_torques_of_a_free_joint_have_parts_as_well():
    mech = pg.Mechanism(MODEL)
    turn = (0.5, 0.5, -0.5, 0.5)
    q = {"b": {"position": (1, 2, 3), "rotation": turn}}
    named = mech.inverse_dynamics(q, {"b": PARTS}, {"b": {"linear": (1, 0, 0)}})
    plain = mech.inverse_dynamics(
        {"b": (1, 2, 3, *turn)}, {"b": (1, 2, 3, 4, 5, 6)}, {"b": (0, 0, 0, 1, 0, 0)}
    )
    np.testing.assert_array_equal(named, plain)
    pushed = mech.forward_dynamics(q, {"b": PARTS}, {"b": {"force": (2, 0, 0)}})
    np.testing.assert_array_equal(
        pushed, mech.forward_dynamics(q, {"b": PARTS}, {"b": (0, 0, 0, 2, 0, 0)})
    )


def test_three_numbers_are_the_position_of_a_free_joint_only():
    """Three numbers of a ball and three slides with seven do not fill a part of its quaternion."""
    assert pg.Body("b", joint="free", q=(1, 2, 3)).q == (1, 2, 3, 1, 0, 0, 0)
    moves = [("ball", (0, 0, 1)), *(("translate", x) for x in np.eye(3).tolist())]
    six = pg.Model([pg.Body("b", joint="compound", motions=moves, inertia=(1, 1, 1))])
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(six, q={"b": (1, 2, 3)}, t_end=0.01)
    assert_names(str(refused.value), "q['b']", "7 numbers", "got 3")


@pytest.mark.parametrize(
    ("call", "facts"),
    [
        (lambda: pg.Shape("cylinder", radius=0.1, half_length=0.2), ("length=2*half_length",)),
        (lambda: pg.Shape("capsule", size=(0.05, 0.1)), ("radius=0.05, length=0.2",)),
        (lambda: pg.Shape("capsule", radius=0.05, fromto=(0, 0, 0, 1, 0, 0)), ("length=", "align")),
        (lambda: pg.Sine(amplitude=1, freq=2), ("frequency", "[rad/s]")),
        (lambda: pg.Sampled(name="p", update="=q.arm", rate=50), ("control 'p', rate", "1/50")),
        (lambda: MODEL.add(pg.Motor("s", "arm", torque="=np.sin(t)")), ("sin, without np.",)),
        (lambda: MODEL.add(pg.Motor("s", "arm", coordinate=1)), ("1 degree", "from 0", "got 1")),
        (lambda: pg.Model([pg.Body("w", joint="weld")], forces=[pg.Motor("s", "w")]),
         ("force 's', coordinate", "'w'", "no degree of freedom")),
    ],
)  # fmt: skip
def test_words_of_others_are_answered_with_what_to_type(call, facts):
    with pytest.raises(pg.PgraphError) as refused:
        call()
    assert_names(str(refused.value), *facts)


def test_a_wrong_value_is_not_said_to_be_missing():
    one = {"radius": -1}, {"size": (1, 1, np.nan)}, {"size": (1, 2, 3)}
    for kind, wrong, field in zip(("sphere", "box", "cylinder"), one, ("radius", "size", "shape")):
        with pytest.raises(pg.ModelError) as refused:
            pg.Shape(kind=kind, **wrong)
        assert [problem.field for problem in refused.value.problems] == [field]


def test_names_of_bodies_are_no_words_of_other_programs():
    """The damping of other programs is c, and a body that is missing is not."""
    with pytest.raises(pg.ModelError) as refused:
        MODEL.add(pg.Motor("s", "arm", torque="=-3*q.c"))
    assert_names(str(refused.value), "no body is named 'c'; choose from b, arm")


@pytest.mark.parametrize(
    ("call", "facts"),
    [
        (lambda: pg.simulate(MODEL, v={"b": {"omega": (1, 0, 0)}}), ("'omega'", "'angular'")),
        (lambda: pg.simulate(MODEL, v={"b": {"linear": 2.0}}), ("'linear'", "3 numbers", "2.0")),
        (lambda: pg.simulate(MODEL, v={"b": {"linear": "fast"}}), ("'linear'", "3 numbers")),
        (lambda: pg.simulate(MODEL, v={"arm": {"linear": (1, 0, 0)}}), ("v['arm']", "free joint")),
        (lambda: pg.simulate(MODEL, q={"b": {"linear": (1, 0, 0)}}), ("'position'", "'rotation'")),
        (lambda: pg.Body("b", joint="free", v={"w": (1, 0, 0)}), ("body 'b', v", "'w'")),
        (lambda: pg.Body("b", v={"linear": (1, 0, 0)}), ("body 'b', v", "free joint")),
    ],
)
def test_parts_that_a_joint_does_not_have_are_named(call, facts):
    with pytest.raises((pg.InputError, pg.ModelError)) as refused:
        call()
    assert_names(str(refused.value), *facts)


def test_an_edit_takes_paths_as_sweeps_and_fits_do():
    model = MODEL.replace(parameters={"m": 1.0})
    one = model.edit("bodies.arm.mass", 2.0)
    assert one == model.edit("arm", mass=2.0)
    several = {"bodies.arm.mass": 2.0, "bodies.b.com.1": 0.5, "gravity.2": -1.6, "m": 3}
    found = model.edit(several)
    assert (found.body("arm").mass, found.body("b").com) == (2.0, (0.0, 0.5, 0.0))
    assert (found.gravity[2], found.parameters["m"]) == (-1.6, 3.0)
    rod = pg.Model([pg.Body("arm", axes=(0, 1, 0), com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1))])
    run = pg.simulate(rod.edit("bodies.arm.mass", 2.0), t_end=0.1)
    fit = pg.fit(rod, {"t": run.t, "arm": run["arm"]}, {"bodies.arm.mass": (0.5, 4.0)})
    assert rod.edit(fit.values).body("arm").mass == fit.values["bodies.arm.mass"]


@pytest.mark.parametrize(
    ("call", "facts"),
    [
        (lambda: MODEL.edit("bodies.arm.mass", "heavy"), ("'heavy'", "edit('arm', mass=...)")),
        (lambda: MODEL.edit("bodies.leg.mass", 1.0), ("bodies.leg.mass", "arm")),
        (lambda: MODEL.edit("arm", 1.0), ("edit, arm", "bodies.NAME.FIELD")),
        (lambda: MODEL.edit("bodies.arm.mass", 1.0, com=(0, 0, 0)), ("Model.edit", "edit({PATH")),
        (lambda: MODEL.edit({"bodies.arm.mass": True}), ("must be a number", "True")),
        (lambda: MODEL.edit("bodies.arm.mass", -1.0), ("arm", "mass", ">= 0")),
    ],
)
def test_a_path_that_cannot_be_edited_is_named(call, facts):
    with pytest.raises((pg.InputError, pg.ModelError)) as refused:
        call()
    assert_names(str(refused.value), *facts)


def test_one_point_or_two_are_taken_under_either_name():
    ball = {"kind": "sphere", "radius": 0.1}
    assert pg.Contact("c", body="b", point=(0, 0, 1)).points == ((0.0, 0.0, 1.0),)
    assert pg.Contact("c", body="b", points=(0, 0, 1)).points == ((0.0, 0.0, 1.0),)
    ends = pg.Distance("d", body="a", other="b", points=((1, 0, 0), (0, 1, 0)))
    assert (ends.point, ends.other_point) == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert pg.Body("a", shape=ball, axes=(0, 0, 2)).axes == ((0.0, 0.0, 2.0),)


RUN = pg.simulate(MODEL, t_end=0.01)
MISSED = {  # a call -> the way to what it asks for
    lambda: pg.Environment: "pg.gym.make",
    lambda: RUN.sol: "run.at",
    lambda: RUN.ground_reaction_force: '"ground"',
    lambda: pg.Mechanism(MODEL).distance: "run.position",
    lambda: pg.Stepper(MODEL).result: "stepper.record",
    lambda: pg.overlay: "Compare",
    lambda: pg.simulate(MODEL, sample=0.02): "pg.Sampled",
    lambda: pg.linearise(MODEL, parameters=["m"]): "model.edit",
}


@pytest.mark.parametrize("call", MISSED)
def test_a_name_of_others_leads_to_ours(call):
    with pytest.raises((AttributeError, pg.InputError)) as refused:
        call()
    assert_names(str(refused.value), MISSED[call])


def test_names_to_choose_from_are_sorted():
    with pytest.raises(AttributeError) as refused:
        _ = RUN.zebra
    names = str(refused.value).partition("choose from ")[2].split(", ")
    assert len(names) > 40
    assert names == sorted(names, key=str.lower)


OWN = {  # a call that passes a wrong argument on -> how its refusal begins
    lambda: pg.Stepper(MODEL, step=1e-3, switches=[1]): "Stepper, switches: ",
    lambda: pg.Stepper(MODEL, step=1e-3, method="euler3"): "Stepper, method: ",
    lambda: pg.BatchStepper(MODEL, 2, step=1e-3, method="euler3"): "BatchStepper, method: ",
    lambda: pg.simulate(MODEL, t_end=0.01, switches=[1]): "simulate, switches: ",
    lambda: pg.simulate(MODEL, t_end=-1.0): "simulate, t_end: ",
    lambda: pg.simulate(MODEL, t_end=0.1, q=[1.0, 2.0]): "simulate, q: ",
    lambda: pg.Stepper(MODEL, step=1e-3, v=[1.0]): "Stepper, v: ",
    lambda: pg.Stepper(MODEL, step=1e-3, inputs={"push": 5.0}): "Stepper, inputs",
    lambda: pg.Mechanism(MODEL).mass_matrix([1.0]): "Mechanism.mass_matrix, q: ",
}


@pytest.mark.parametrize("call", OWN)
def test_a_refusal_names_the_call_that_was_typed(call):
    with pytest.raises(pg.InputError) as refused:
        call()
    assert str(refused.value).startswith(OWN[call])

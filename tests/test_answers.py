"""Messages for users of other programs: their advice can be pasted, and comes once."""

import warnings
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from .test_parts_of_others import ARM, LOOSE, SPHERE, TWO

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("name", "ours"),
    [
        ("gradient", "run.gradient"),
        ("Simulator", r"Stepper\(model\)"),
    ],
)
def test_a_function_of_another_program_is_answered_with_ours(name, ours):
    with pytest.raises(AttributeError, match=ours):
        getattr(pg, name)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda model: pg.simulate(model, q=np.zeros((9, 2))), r"pg\.simulate_batch\(model, q, v"),
        (lambda model: pg.simulate(model, forces=lambda t, q, v: 0.0), "tau"),
        (lambda _: pg.simulate(pg.Model.serial(3), (0, 5), [0.1] * 3), "t_span="),
        (lambda model: pg.simulate(model, (0, 5), q0=[0.1]), "5] is in the place of q"),
        (lambda model: pg.simulate(model, t_end=0.1).show(fps=30), "fps"),
        (lambda model: pg.PID(name="p", signal="q.arm", kp=1.0), "'=q.arm'"),
    ],
)
def test_a_refusal_names_what_to_write(call, named):
    with pytest.raises(pg.PgraphError, match=named):
        call(pg.Model.serial(2))


@pytest.mark.parametrize(
    ("change", "falls"),
    [
        ({}, True),
        ({"contacts": [pg.Contact(name="c", body="b")]}, False),
        ({"gravity": (0, 0, 0)}, False),
        ({"constraints": [pg.Point(name="p", body="b", other="ground")]}, False),
    ],
)
def test_a_loose_body_that_touches_nothing_is_doubted(change, falls):
    box = pg.Shape(kind="box", size=(0.2, 0.2, 0.2))
    body = pg.Body(name="b", joint="free", shape=box, derived=("inertia",))
    doubts = pg.Model(bodies=[body], **change).doubts
    assert any("contact" in text for text in doubts) == falls


@pytest.mark.parametrize(
    "given", [{"q": np.zeros((3, 3))}, {"v": np.zeros(1)}, {"q": "a"}, {"q": np.zeros((2, 2, 2))}]
)
def test_rows_that_are_no_states_are_refused(given):
    with pytest.raises(pg.InputError, match=r"simulate_batch, [qv]: must have"):
        pg.simulate_batch(TWO, **given, t_end=0.1)


def test_all_wrong_arguments_of_a_call_are_named_at_once():
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(TWO, stop=1.0, speeds=[1.0], initial=[0.0])
    assert [problem.field for problem in refused.value.problems] == ["stop", "speeds", "initial"]


GAINS = {"kp": 30.0, "kd": 4.0, "target": 0.5}


def pasted(error, name):
    """Return the list that a message gives for an argument, as if it were pasted."""
    text = str(error.value)
    start = text.rindex(f"{name}=[") + len(name) + 1
    return eval(text[start : text.index(")]", start) + 2], {"pg": pg})


@pytest.mark.parametrize("ki", [0.0, 7.0])
@pytest.mark.parametrize("word", ["joint", "body"])
def test_a_pid_of_a_joint_is_answered_with_parts_of_the_same_law(word, ki):
    with pytest.raises(pg.ModelError) as refused:
        pg.PID(**{word: "arm"}, **GAINS, ki=ki)
    assert len(refused.value.problems) == 1
    controls = pasted(refused, "controls") if ki else ()
    model = pg.Model([ARM], controls=controls, forces=pasted(refused, "forces"))
    run = pg.simulate(model, t_end=1.0, rtol=1e-10)
    missed = np.cumsum((0.5 - run["arm"])[:-1] * np.diff(run.t))
    wanted = 30.0 * (0.5 - run["arm"]) - 4.0 * run.v["arm"]
    wanted[1:] += ki * missed
    given = run.mechanism.inverse_dynamics(run.q, run.v, run.vdot)
    np.testing.assert_allclose(given[:, 0], wanted, atol=0.02)


def test_a_pid_in_the_place_of_torques_is_answered_with_what_applies_it():
    pid = pg.PID("p", signal="=q.arm", setpoint=0.5, kp=30.0)
    with pytest.raises(pg.InputError, match="tau") as refused:
        pg.simulate(pg.Model([ARM]), tau=pid, t_end=0.1)
    line = str(refused.value).partition("model = ")[2]
    driven = eval(line, {"pg": pg, "model": pg.Model([ARM]), "control": pid})
    assert pg.simulate(driven, t_end=1.0)["arm"][-1] != 0.0


@pytest.mark.parametrize("number", [1, 2])
def test_loose_shapes_are_doubted_until_the_contacts_of_the_message_hold_them(number):
    bodies = [LOOSE.model_copy(update={"name": f"b{k}", "link": (k, 0, 1)}) for k in range(number)]
    said = next(text for text in pg.Model(bodies).doubts if "would fall" in text)
    contacts = eval(said.partition("contacts=")[2], {"pg": pg})
    assert pg.Model(bodies, contacts=contacts).doubts == ()
    for some in ([contacts[0]], contacts[1:]):
        assert bool(pg.Model(bodies, contacts=some).doubts) == (number > 1 or not some)
    limb = pg.Body("limb", "b0", shape=SPHERE)
    assert pg.Model([*bodies[:1], limb], contacts=[pg.Contact(body="limb")]).doubts == ()
    table = pg.Body("table", joint="weld", shape=SPHERE)
    held = pg.Model([*bodies, table], contacts=[pg.Contact(body="*", other="*")])
    assert held.doubts == ()


def test_arguments_that_are_passed_on_are_not_called_unknown():
    with pytest.raises(pg.InputError, match="positional") as refused:
        pg.fit(TWO, {}, {}, 1.0, 2.0, q0=[0.0])
    assert "q0" not in str(refused.value)


def test_contacts_of_the_message_are_those_of_all_shapes():
    with pytest.raises(pg.ModelError) as refused:
        pg.Model([LOOSE], contacts="all")
    line = str(refused.value).partition("contacts=")[2]
    assert pg.Model([LOOSE], contacts=eval(line, {"pg": pg})).doubts == ()


def test_the_axis_of_the_message_is_that_of_the_joint():
    loop = pg.Revolute("loop", body="hand", point=(0, 0, -1))
    said = next(text for text in TWO.add(loop).doubts if "'loop'" in text)
    axis = eval(said.rpartition("axis=")[2])
    aligned = loop.model_copy(update={"axis": axis})
    assert TWO.add(aligned).doubts == ()


@pytest.mark.parametrize("call", ["jacobian", "pose", "velocity", "jacobian_bias"])
def test_a_name_in_the_place_of_q_is_told_with_the_order_of_the_arguments(call):
    mech = pg.Mechanism(pg.Model.serial(2))
    with pytest.raises(pg.InputError, match=rf"{call}, q: .*'2'.*\(q, .*name"):
        getattr(mech, call)("2", *mech.home())


def test_a_velocity_behind_the_name_is_told_with_the_order_of_the_arguments():
    mech = pg.Mechanism(pg.Model.serial(2))
    q, v = mech.home()
    with pytest.raises(pg.InputError, match=r"velocity, v: .*'2'.*\(q, v, name"):
        mech.velocity(q, "2", v)


def test_an_interval_in_the_place_of_q_is_refused():
    """As in SciPy's solve_ivp(f, (0, 5), [1, 0.2])."""
    model = pg.Model.serial(2)
    with pytest.raises(pg.InputError, match=r"t_span=\(0, 0.5\).*\[0, 0.5\]"):
        pg.simulate(model, (0, 0.5), [1, 0.2])
    for q, times in (((0, 0.5), {"t_end": 0.1}), ((0.1, 0.5), {}), ([0, 0.5], {})):
        assert pg.simulate(model, q, [1, 0.2], **times).q[0].tolist() == [*q]


def test_a_run_prints_why_its_error_is_not_estimated():
    run = pg.simulate(pg.Model.serial(1), t_end=0.1, tau=lambda t, q, v: -v)
    assert "estimate=True" in str(run)
    assert len(str(pg.simulate(pg.Model.serial(1), t_end=0.1, estimate=False)).splitlines()) == 1


def test_an_argument_that_is_missing_is_told_beside_options():
    """A name that goes to the runs was called unknown if another argument was missing."""
    rod: Any = pg.Model.serial(1)
    calls: list[tuple[Any, str]] = [
        (lambda: pg.fit(rod, {}, tau=0), "'free'"), (lambda: pg.sweep(rod, {}, t_end=1), "'metric'")
    ]  # fmt: skip
    for call, name in calls:
        with pytest.raises(pg.InputError, match=name):
            call()


def test_torques_of_all_joints_are_warned_of_once_where_a_loop_leaves_a_choice():
    mech = pg.Mechanism(pg.load("four_bar"))
    q, v, _ = mech.assemble()
    vdot, _ = mech.constrained_dynamics(q, v)
    calls = ({"actuated": mech.names}, {}, {})
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        told = [
            (mech.constrained_inverse_dynamics(q, v, vdot, **call), len(found))[1] for call in calls
        ]
    assert told == [0, 1, 1]
    assert "actuated" in str(found[0].message)


def test_a_run_says_that_a_file_has_an_impossible_inertia():
    body = pg.Body(name="a", axes="y", com=(0, 0, -1), inertia=(1, 1, 9), any_inertia=True)
    model = pg.Model.from_json(pg.Model([body]).to_json())
    assert any("'a'" in text and "inertia" in text for text in model.doubts)
    assert set(model.doubts) <= set(pg.simulate(model, t_end=0.01).notices)


def test_the_unit_of_frequencies_stands_beside_them():
    model = pg.Model([pg.Body("a", axes="y", com=(0, 0, -9.81))])
    np.testing.assert_allclose(model.linearise().hertz, [1.0 / (2.0 * np.pi)], rtol=1e-12)
    for owner in (pg, model, pg.Mechanism(model), model.linearise()):
        with pytest.raises(AttributeError, match=r"frequencies \[rad/s\] or .*hertz \[Hz\]"):
            owner.natural_frequencies  # noqa: B018
    with pytest.raises(AttributeError, match=r"modes or .*hertz \[Hz\]"):
        pg.modes  # noqa: B018


def test_values_of_a_fit_say_which_paths_they_have():
    from pgraph_core.search.free import Values

    with pytest.raises(KeyError, match=r"bodies\.arm\.mass.*x"):
        Values({"bodies.arm.mass": 1.0})[0]


def test_each_call_that_ignores_constraints_warns_once():
    mech = pg.Mechanism(pg.load("four_bar"))
    state = np.zeros(3), np.zeros(3), np.zeros(3)
    with pytest.warns(UserWarning, match="inverse_dynamics ignores"):
        tau = mech.inverse_dynamics(*state)
    with pytest.warns(UserWarning, match="forward_dynamics ignores"):
        vdot = mech.forward_dynamics(*state)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(mech.inverse_dynamics(*state), tau)
        assert np.array_equal(mech.forward_dynamics(*state), vdot)


@pytest.mark.parametrize("call", [pg.jacobian, pg.pose])
@pytest.mark.parametrize("word", ["body", "frame", "link"])
def test_a_frame_is_asked_for_by_its_name(call, word):
    if (call, word) != (pg.jacobian, "frame"):  # which chooses its axes
        with pytest.raises(pg.InputError, match="did you mean name"):
            call(pg.Model.serial(2), np.zeros(2), **{word: "2"})

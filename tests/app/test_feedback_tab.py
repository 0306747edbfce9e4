"""State feedback on the page: gains against SciPy's Riccati solution, runs that balance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from scipy.signal import step

import pgraph_core as pg
from pgraph_app.core.cells import Display
from pgraph_app.feedback import SETTLED
from pgraph_app.feedback.view import feedback
from pgraph_app.run import Request

from ..core.test_feedback import PLANTS, cart_pole, linear
from ..nights import combined
from .store import ME, after, answered, begun, do, notice, reply


def design(state):
    return state.clients[ME].design


def edit(field, *texts, at=0):
    """Return the event that types into cells of a field, from cell `at` on."""
    return do.EditFeedback(ME, 1, field, tuple(((at + k,), text) for k, text in enumerate(texts)))


@pytest.mark.parametrize("plant", PLANTS)
def test_gains_are_scipys_and_one_click_balances_the_model(plant):
    model, rates, chosen, start = plant()
    state = answered(begun(model), do.OpenFeedback(ME), edit("states", *chosen))
    now = design(state)
    A, B = linear(rates)
    largest = [now.largest[name] for name in (*now.found.states, *now.found.inputs)]
    Q, R = np.diag(np.array(largest[:4]) ** -2.0), np.diag(np.array(largest[4:]) ** -2.0)
    wanted = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))
    assert np.allclose(now.found.K, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())
    added = after(state, do.AddFeedback(ME))
    assert design(added) is None
    assert added.model == now.found.model
    assert after(added, do.Undo(ME)).model is model
    mech = pg.Mechanism(added.model)
    q = np.zeros(mech.nq)
    for name, x in zip(chosen, start):
        q[mech.joints[name].q] = x
    q, *_ = mech.assemble(q, np.zeros(mech.nv))
    run = pg.simulate(mech, t_end=30.0, q=q)
    assert np.abs(run.q[-1]).max() < 1e-3


def without_motor():
    return pg.Model.serial(2)


def horizontal():
    return pg.Model.serial(2).add(pg.Motor(name="m", body="1"))


def uncontrolled():
    slide = {"joint": "prismatic", "axes": ((1, 0, 0),)}
    bodies = pg.Body(name="a", **slide), pg.Body(name="b", **slide)
    return pg.Model(bodies=bodies, forces=(pg.Motor(name="m", body="a"),))


@pytest.mark.parametrize("model", [without_motor, horizontal, uncontrolled])
def test_why_there_is_no_feedback_is_said_without_names_of_python(model):
    problem = design(answered(begun(model()), do.OpenFeedback(ME))).problem
    assert problem
    assert not any(word in problem for word in ("lqr", "mech", "model.", "pg.", "Q, R"))


@pytest.mark.parametrize("text", ["-1, -2", "-1, -1, -1, -1", "-1+1i, -1, -1, -1"])
def test_poles_that_cannot_be_placed_are_refused_in_words(text):
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME))
    problem = design(answered(state, edit("method", "poles"), edit("poles", text))).problem
    assert problem
    assert not any(word in problem for word in ("rank", "[", "got"))


def test_the_dialog_calls_states_by_words():
    model, *_ = cart_pole()
    now = design(answered(begun(model), do.OpenFeedback(ME)))
    shown = feedback(now, Display())
    labels = [field["label"] for group in shown["groups"] for field in group["fields"]]
    words = [f"{what} of {name}" for what in ("position", "speed") for name in ("cart", "pole")]
    assert {*words, *now.found.inputs} <= {*labels}
    assert [name for name, *_ in shown["curves"]] == [*words[:2], *now.found.inputs]


@pytest.mark.parametrize("factor", [0.5, 10.0])
def test_a_smaller_deviation_is_held_by_larger_gains(factor):
    """The weights are one over the square of what is allowed."""
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME))
    before = design(state)
    names = [*before.found.inputs, *before.found.states]
    text = repr(factor * before.largest["q.pole"])
    state = answered(state, edit("largest", text, at=names.index("q.pole")))
    now = design(state)
    Q = {name: now.largest[name] ** -2.0 for name in now.found.states}
    assert Q["q.pole"] == pytest.approx(before.largest["q.pole"] ** -2.0 / factor**2)
    assert np.array_equal(now.found.K, pg.lqr(model, Q, now.largest["push"] ** -2.0).K)


def test_poles_are_placed_and_begin_with_those_of_lqr():
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME))
    before = design(state).found.poles
    state = answered(state, edit("method", "poles"))
    assert np.allclose(np.sort_complex(design(state).found.poles), np.sort_complex(before))
    wanted = np.array([-2, -4, -3 + 1j, -3 - 1j])
    state = answered(state, edit("poles", "-2, -4, -3+1i, -3 - 1i"))
    assert np.allclose(np.sort_complex(design(state).found.poles), np.sort_complex(wanted))
    shown = feedback(design(state), Display())
    assert sorted(shown["poles"]) == sorted(["-2", "-4", "-3 ± 1i"])


def test_the_response_ends_at_the_step_of_what_is_chosen():
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME))
    curves = {name: y for name, _, y in feedback(design(state), Display())["curves"]}
    assert curves["position of cart"][0] == 0.0
    assert curves["position of cart"][-1] == pytest.approx(1.0, abs=0.05)
    assert curves["position of pole"][-1] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("events", "parts"),
    [
        ([edit("largest", "-1")], ("above 0",)),
        ([edit("largest", "much")], ("number", "much")),
        ([edit("largest", "1 kg")], ("kg",)),
        ([edit("largest", "1", at=40)], ("field",)),
        ([edit("poles", "fast")], ("-3+1i",)),
        ([edit("poles", "1" * 20_000 + "x")], ("-3+1i",)),
        ([edit("states", "a", at=9)], ("field",)),
        ([do.CloseFeedback(ME), edit("step", "q.pole")], ("no longer",)),
    ],
)
def test_what_cannot_be_is_refused_beside_its_cell(events, parts):
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME), *events)
    assert all(part in reply(state) for part in parts), reply(state)
    assert state.model is model


@pytest.mark.parametrize("what", ["no drive", "tilted", "poles", "unreached"])
def test_why_there_are_no_gains_is_said_in_the_dialog(what):
    model, *_ = cart_pole()
    events, part = [], {"no drive": "motor", "tilted": "input", "poles": "4 poles",
                        "unreached": "arm"}[what]  # fmt: skip
    if what == "no drive":
        model = model.replace(forces=())
    elif what == "tilted":
        model = model.edit("pole", q=0.5)
    elif what == "poles":
        events = [edit("method", "poles"), edit("poles", "-1, -2")]
    else:
        model = model.add(pg.Body(name="arm", axes=[(0, 0, 1)], com=(0, 1, 0)))
    state = answered(begun(model), do.OpenFeedback(ME), *events)
    shown = feedback(design(state), Display())
    assert part in shown["problem"]
    assert shown["gains"] is None
    assert after(state, do.AddFeedback(ME)).model is model


def test_gains_of_a_model_that_was_changed_are_computed_again():
    model, *_ = cart_pole()
    state = answered(begun(model), do.OpenFeedback(ME))
    old = design(state).found
    state = after(state, do.EditBodies(ME, 1, ("cart",), "mass", (((), "3"),)))
    state = answered(state, do.AddFeedback(ME))
    assert "changed" in notice(state)
    assert not np.allclose(design(state).found.K, old.K)
    now = design(state).found
    assert after(state, do.AddFeedback(ME)).model is now.model


def test_an_answer_that_is_too_late_is_not_shown():
    model, *_ = cart_pole()
    state = after(begun(model), do.OpenFeedback(ME))
    (errand,) = state.errands
    state = after(state, do.CloseFeedback(ME))
    assert design(answered(state)) is None
    assert errand.compiled


@pytest.mark.parametrize(
    ("gains", "how", "setpoint"),
    combined(
        [(4, 8, 0, 1), (1, 20, 0, 0.5), (6, 1, 2, 3), (0, 5, 3, 1)],
        [
            {"rtol": 1e-11},
            {"method": "dopri5", "step": None, "rtol": 1e-9},
            {"method": "rk4", "step": 2e-3},
        ],
        [0.0, -5.0, "=sin(3*t)"],
    ),
)
def test_the_step_response_of_a_pid_is_that_of_its_transfer_function(gains, how, setpoint):
    """A wheel 1/(I s) whose speed is controlled by kp + ki/s + kd s/(T s + 1)."""
    kp, ki, kd, inertia = gains
    lag = 0.1
    wheel = pg.Body(name="wheel", axes=[(0, 0, 1)], inertia=(inertia,) * 3, v=1.0)
    control = pg.PID(name="signal", signal="=2*v.wheel - v.wheel", setpoint=setpoint,
                     kp=kp, ki=ki, kd=kd, filter=lag)  # fmt: skip
    model = pg.Model(bodies=[wheel], gravity=(0, 0, 0), controls=[control],
                     forces=[pg.Motor(name="push", body="wheel", torque="=x.signal")])  # fmt: skip
    state = begun(model)
    state = replace(state, request=Request(t_end=3.0, **how))
    state = answered(state, do.AskResponse(ME, "signal"))
    found = state.clients[ME].response
    assert found.problem == ""
    (_, t, y), (_, _, u) = found.curves
    top = [kp * lag + kd, kp + ki * lag, ki]
    _, wanted = step((top, np.polyadd([inertia * lag, inertia, 0, 0], top)), T=np.array(t))
    assert np.allclose(y, wanted, rtol=0, atol=1e-6)
    assert u[0] == pytest.approx(kp + kd / lag)
    assert found.overshoot == pytest.approx(max(wanted.max() - 1, 0), abs=1e-6)
    assert found.left == pytest.approx(1 - wanted[-1], abs=1e-6)
    late = wanted[np.array(t) >= 0.8 * t[-1]]
    assert (found.settled is None) == (np.ptp(late) > SETTLED)
    if found.settled is not None:
        near = np.abs(wanted - late.mean()) <= SETTLED * (1 + 1e-4)
        assert near[np.array(t) >= found.settled].all()
    assert state.model is model


@pytest.mark.parametrize("name", ["lag", "gone"])
def test_only_a_pid_has_a_step_response(name):
    lag = pg.Filter(name="lag", input="=v.one", lag=0.1)
    model = pg.Model(bodies=[pg.Body(name="one")], controls=[lag])
    found = answered(begun(model), do.AskResponse(ME, name)).clients[ME].response
    assert "PID" in found.problem
    assert found.curves == ()


def test_a_controller_without_gains_says_so_instead_of_a_flat_response():
    wheel = pg.Body(name="wheel", axes=[(0, 0, 1)], inertia=(1, 1, 1))
    model = pg.Model(bodies=[wheel], controls=[pg.PID(name="signal", signal="=q.wheel")])
    found = answered(begun(model), do.AskResponse(ME, "signal")).clients[ME].response
    assert "gain" in found.problem


def test_states_of_controls_are_fed_back_with_a_deviation_of_their_own():
    body = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=2.0)
    total = pg.State(name="sum", rate="=q.s - 0.5")
    model = pg.Model(
        bodies=[body], gravity=(0, 0, 0), controls=[total], forces=[pg.Motor(name="p", body="s")]
    )
    state = answered(begun(model.edit("s", q=[0.5])), do.OpenFeedback(ME))
    now = design(state)
    assert now.problem == ""
    assert now.found.states == ("q.s", "v.s", "x.sum[1]")
    assert now.found.stable
    assert now.largest["x.sum[1]"] == 1.0
    assert "x.sum[1]" in str(feedback(now, Display()))
    before = now.found.K[0, 2]
    state = answered(state, edit("largest", "0.1", at=3))
    assert design(state).found.K[0, 2] > 5 * before

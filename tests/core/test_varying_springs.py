"""Springs and dampers between bodies whose stiffness and damping are expressions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_core.study import axes
from tests.refusals import assert_names

from ..nights import combined

Z, X = (0, 0, 1), (1, 0, 0)
METHODS = ["rk4", "gauss6", "dop853", "radau5"]


def slider(**spring):
    """A mass on a line, 2 m from the other end of its spring."""
    body = pg.Body(name="b", joint="prismatic", axes=[X], mass=2.0, inertia=(0.1, 0.1, 0.1))
    own = pg.Spring(name="s", body="b", other_point=(-2, 0, 0), rest=1.5, **spring)
    return pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[own], parameters={"k": 40.0})


def twisted(**torsion):
    a = pg.Body(name="a", axes=[Z], mass=1.0, inertia=(0.2, 0.2, 0.3))
    b = pg.Body(name="b", parent="a", axes=[Z], mass=1.0, inertia=(0.1, 0.1, 0.2))
    own = pg.Torsion(name="s", body="b", other="a", axis=Z, rest=0.2, **torsion)
    return pg.Model(bodies=[a, b], gravity=(0, 0, 0), forces=[own], parameters={"k": 4.0})


# expressions, and the force that follows from t, q and v
LINE = {
    "in time": (
        {"stiffness": "=k*(1 + 0.5*sin(7*t))", "damping": 0.3},
        lambda t, q, v: -40 * (1 + 0.5 * np.sin(7 * t)) * (q + 0.5) - 0.3 * v,
    ),
    "in the motion": (
        {"stiffness": "=k*(1 + q.b^2)", "damping": "=0.2 + abs(v.b)"},
        lambda t, q, v: -40 * (1 + q * q) * (q + 0.5) - (0.2 + abs(v)) * v,
    ),
    "of a damper": ({"damping": "=1 + t"}, lambda t, q, v: -(1 + t) * v),
    "negative": ({"stiffness": "=-3*t"}, lambda t, q, v: 3 * t * (q + 0.5)),
}


def solved(force, t_end, mass=2.0, q=0.3, v=1.0):
    found = solve_ivp(
        lambda t, y: (y[1], force(t, *y) / mass), (0, t_end), (q, v), rtol=1e-12, atol=1e-13,
        method="DOP853",
    )  # fmt: skip
    return found.y[:, -1]


@pytest.mark.parametrize(("case", "method"), combined(LINE, METHODS))
def test_a_spring_follows_its_expressions(case, method):
    fields, force = LINE[case]
    how = {"rtol": 1e-10} if method in ("dop853", "radau5") else {"step": 1e-3}
    run = pg.simulate(slider(**fields), q=[0.3], v=[1.0], t_end=2.0, method=method, **how)
    end = solved(force, 2.0)
    assert np.allclose([run.q[-1, 0], run.v[-1, 0]], end, rtol=0, atol=2e-8)
    assert run.energy_drift < 1e-6


def test_time_stepping_takes_them_to_its_order():
    fields, force = LINE["in time"]
    model = slider(**fields).edit("b", limits=[(-9.0, 9.0)])
    off = []
    for step in (4e-3, 2e-3, 1e-3):
        run = pg.simulate(model, q=[0.3], v=[1.0], t_end=1.0, step=step, method="moreau_jean")
        off.append(abs(run.q[-1, 0] - solved(force, 1.0)[0]))
    assert off[2] < 0.6 * off[1] < 0.4 * off[0]
    assert off[2] < 1e-3


@pytest.mark.parametrize("make", [slider, twisted])
@pytest.mark.parametrize("name", ["stiffness", "damping"])
def test_an_expression_of_a_constant_is_the_constant(make, name):
    fields = {"stiffness": 30.0, "damping": 0.5}
    start = {"q": [0.3] * len(make().bodies), "t_end": 1.0, "rtol": 1e-10}
    plain = pg.simulate(make(**fields), **start)
    said = pg.simulate(make(**{**fields, name: f"={fields[name]} + 0*t"}), **start)
    assert np.allclose(said.q[-1], plain.q[-1], rtol=0, atol=1e-10)
    assert said.energy_drift < 1e-6
    assert np.array_equal(said.potential_energy, np.zeros(len(said.t)))  # its power is work


def test_a_torsion_spring_reads_what_other_bodies_do():
    model = twisted(stiffness="=k + v.a", damping="=0.1*(1 + q.a^2)")
    run = pg.simulate(model, q=[0.4, -0.3], v=[0.5, 0.1], t_end=2.0, rtol=1e-11)

    def rate(t, y):
        a, b, u, w = y
        torque = -(4 + u) * (b - 0.2) - 0.1 * (1 + a * a) * w
        return u, w, -torque / 0.3, torque / 0.2 + torque / 0.3

    end = solve_ivp(rate, (0, 2), (0.4, -0.3, 0.5, 0.1), rtol=1e-12, atol=1e-13, method="DOP853")
    assert np.allclose(run.q[-1], end.y[:2, -1], rtol=0, atol=1e-8)


def test_a_semi_active_damper_reads_a_filter():
    """A damper that is on while the body and the spring move apart (skyhook)."""
    on = pg.Filter(name="slow", input="=v.b", lag=0.05)
    damper = pg.Spring(
        name="s", body="b", other_point=(-2, 0, 0), rest=1.5, stiffness=40.0,
        damping="=smoothstep(x.slow, -0.1, 0.1)",
    )  # fmt: skip
    model = slider().replace(controls=[on], forces=[damper])
    run = pg.simulate(model, q=[0.3], t_end=2.0, rtol=1e-9)

    def rate(t, y):
        s = min(max((y[2] + 0.1) / 0.2, 0.0), 1.0)
        force = -40 * (y[0] + 0.5) - s * s * (3 - 2 * s) * y[1]
        return y[1], force / 2, (y[1] - y[2]) / 0.05

    end = solve_ivp(rate, (0, 2), (0.3, 0.0, 0.0), rtol=1e-11, atol=1e-12, method="DOP853")
    assert np.allclose([run.q[-1, 0], run.states[-1, 0]], end.y[[0, 2], -1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_all_ways_to_run_have_the_same_bits(method, tmp_path):
    from pgraph_core.live.run import LiveRun, Setup

    model = slider(**LINE["in the motion"][0]).edit("b", q=[0.3], v=[1.0])
    call = {"step": 2.0**-7, "method": method}
    run = pg.simulate(model, t_end=1.0, frames=129, **call)
    stepper, batch = pg.Stepper(model, **call), pg.BatchStepper(model, 3, **call)
    live = LiveRun(pg.Mechanism(model), Setup(step=call["step"]), method)
    stepper.step(n=128)
    batch.step(n=128)
    while live.record.steps.clock["time"] < 1.0:  # steps end where abs(v.b) has its corner
        live.record.steps.advance(1)
    last = {"last": lambda run: float(run.q[-1, 0])}
    swept = pg.sweep(model, {"k": [30.0, 40.0]}, last, t_end=1.0, **call)
    model.save(tmp_path / "m.json")
    again = pg.simulate(pg.load(tmp_path / "m.json"), t_end=1.0, **call)
    for q in (stepper.q, batch.q[1], live.record.steps.q, swept["last"][1:], again.q[-1]):
        assert np.array_equal(np.ravel(q), run.q[-1])


def test_derivatives_linearisation_and_equilibrium_have_the_slopes_of_the_law():
    model = slider(stiffness="=k*(1 + q.b^2)", damping="=0.2 + q.b").replace(gravity=(-9.81, 0, 0))
    q = float(pg.Mechanism(model).equilibrium()[0])
    assert abs(40 * (1 + q * q) * (q + 0.5) + 2 * 9.81) < 1e-8
    A, _ = pg.Mechanism(model).linearise([q])
    slope = 40 * (2 * q * (q + 0.5) + 1 + q * q)
    assert np.allclose(A, [[0, 1], [-slope / 2, -(0.2 + q) / 2]], rtol=0, atol=1e-6)
    call = {"t_end": 1.0, "q": [0.3], "rtol": 1e-11}
    run = pg.simulate(model, wrt=["k"], **call)
    ends = [pg.simulate(model.replace(parameters={"k": k}), **call).q[-1, 0] for k in (39.9, 40.1)]
    assert abs(run.sensitivity("k")[-1, 0] - (ends[1] - ends[0]) / 0.2) < 1e-6


REFUSED = [
    ({"stiffness": "=q.b"}, ["'s'", "stiffness", "m", "N/m"]),
    ({"damping": "=force.hold"}, ["'s'", "damping", "hold"]),
    ({"stiffness": "=q.c"}, ["'c'", "b"]),
    ({"stiffness": -1.0}, ["stiffness", ">= 0", "-1.0"]),
]


@pytest.mark.parametrize(("fields", "facts"), REFUSED)
def test_expressions_that_do_not_fit_are_refused(fields, facts):
    with pytest.raises(pg.ModelError) as error:
        slider(**fields)
    assert_names(str(error.value), *facts)


def test_a_division_by_zero_names_the_spring():
    run = pg.simulate(slider(stiffness="=k/(t - 0.5)"), q=[0.3], t_end=1.0, step=0.01, method="rk4")
    assert not run.status.ok
    assert_names(run.message, "'s'", "=k/(t - 0.5)")


def test_names_files_and_exports_follow(tmp_path):
    model = slider(stiffness="=k*(1 + q.b^2)").edit("b", name="the body")
    assert model.forces[0].stiffness == '=k*(1 + q["the body"]^2)'
    text = model.to_json()
    assert '"schema_version": 8' in text
    assert pg.Model.from_json(text) == model
    assert '"schema_version": 8' not in slider(stiffness="=2*k").to_json()
    pg.write_mjcf(model, tmp_path / "m.xml")
    assert "stiffness" not in (tmp_path / "m.xml").read_text()


def test_an_axis_of_a_study_changes_springs_of_constant_stiffness_alone():
    plain, varied = slider(stiffness=3.0, damping=0.1), slider(stiffness="=k*(1 + t)")
    both = plain.add(varied.forces[0].model_copy(update={"name": "other"}))
    new = axes.stiffness(both, 2.0)
    assert new.forces[0] != both.forces[0]
    assert new.forces[1] == both.forces[1]
    with pytest.raises(pg.InputError):
        axes.stiffness(varied, 2.0)

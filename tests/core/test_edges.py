"""Steps end where a comparison of times within an expression changes, in every kind of run."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_core.engine.edges import edges
from pgraph_core.packing.programs import of_time

from ..nights import combined

Z = (0, 0, 1)
X = (1, 0, 0)


def edges_of(text, begin, end, most=1000, **parameters):
    out = np.empty(most)
    return out[: edges(of_time(text, parameters), begin, end, out)]


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("=if(t > 0.3, 1, 0)", [0.3]),
        ("=if(0.3 <= t, 1, 0)", [0.3]),
        ("=if(t > 0.3 and t < 0.3 + 1e-9, 1, 0)", [0.3, 0.3 + 1e-9]),
        ("=if(2*t - 1 > k, 1, 0)", [0.9]),
        ("=if(not t^2 < 0.25, t, 1)", [0.5]),
        ("=table(t, 0.1, 0, 0.2, 5, 0.7, 1)", [0.1, 0.2, 0.7]),
        ("=smoothstep(t, 0.25, 0.75)", [0.25, 0.75]),
        ("=max(0, t - 0.4) + min(t, 0.6) + abs(t - 0.5)", [0.4, 0.5, 0.6]),
        ("=if(sin(20*pi*t) > 0, 1, -1)", list(np.arange(1, 20) / 20)),
        ("=if(exp(-t) < 0.5 or log(1 + t) > 0.1, 1, 0)", [math.expm1(0.1), math.log(2)]),
        ("=if(max(t - 0.5, 0) > 0, 1, 0)", [0.5]),
        ("=if(cos(40*pi*t) > 1, 1, 0)", []),
        ("=if(sqrt(t)*tan(t) > 0.5, 1/(t - 2), atan(t))", [0.5806834425058771]),
        ("=sin(t)", []),
        ("=if(2 > 1, t, 0)", []),
    ],
)
def test_edges_are_where_comparisons_change(text, places):
    found = edges_of(text, 0.0, 1.0 - 1e-9, k=0.8)
    assert np.allclose(found, places, rtol=0, atol=1e-9)
    for t in found:  # the first time with the new result
        before = t - 1e-12
        assert edges_of(text, before, t, k=0.8).tolist() == [t]
        assert not len(edges_of(text, before, np.nextafter(t, 0), k=0.8))


@pytest.mark.parametrize("begin", [0.0, -3.0, 1.5, 1e6, 1e-200])
@pytest.mark.parametrize("span", [1e-3, 1.0, 1e6])
def test_an_edge_within_rounding_of_the_start_belongs_to_it(begin, span):
    near = np.nextafter(begin, np.inf)
    for text in ("=if(t > b, 1, 0)", "=max(0, sin(t - b))", "=abs(t - n)"):
        found = edges_of(text, begin, begin + span, b=begin, n=near, most=3)
        assert (found > begin + 0.5 * span * min(1.0, 3.0 / span)).all()


@given(
    st.lists(st.floats(1e-3, 0.999), min_size=1, max_size=9, unique_by=lambda x: round(x, 12)),
    st.floats(1e-6, 1e6),
)
@settings(max_examples=40, deadline=None)
def test_any_pulses_are_found(places, size):
    text = "=" + " + ".join(f"if(t > {x * size!r}, 1, 0)" for x in places)
    found = edges_of(text, 0.0, size)
    assert np.array_equal(found, np.unique([np.nextafter(x * size, np.inf) for x in places]))


@pytest.mark.parametrize(
    "text", ["=if(sin(t)^2 + cos(t)^2 > 1, 1, 0)", "=abs((t - 1)*(t + 1) - (t*t - 1))"]
)
def test_equal_curves_take_bounded_time(text):
    assert len(edges_of(text, 0.0, 1.0, most=3)) <= 3


def slider(torque, **fields):
    body = pg.Body(name="s", joint="prismatic", axes=[X], mass=2.0)
    drive = pg.Motor(name="p", body="s", torque=torque)
    return pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[drive], **fields)


PULSE = "=if(t > a and t < a + w, f, 0)"
HOW = {
    "rk4": {"method": "rk4", "step": 0.02},
    "semi_implicit_euler": {"method": "semi_implicit_euler", "step": 0.02},
    "gauss6": {"method": "gauss6", "step": 0.02},
    "dopri5": {"method": "dopri5", "rtol": 1e-6},
    "dop853": {"method": "dop853", "rtol": 1e-6},
    "radau5": {"method": "radau5", "rtol": 1e-6},
    "radau5 fixed": {"method": "radau5", "step": 0.02},
}


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize(("a", "w"), [(0.3, 0.2), (0.3, 1e-3), (1 / 3, 1e-7), (0.123, 0.5)])
def test_pulses_of_any_length_give_their_impulse(how, a, w):
    f = 3.0 / w
    run = pg.simulate(slider(PULSE, parameters={"a": a, "w": w, "f": f}), t_end=1.0, **HOW[how])
    assert run.status.ok
    assert np.isclose(run.v[-1, 0], 1.5, rtol=1e-8)
    exact = 1.5 * (1.0 - a - 0.5 * w)
    assert np.isclose(run.q[-1, 0], exact, rtol=0, atol=2.1 * run.error_estimate + 1e-8)


def test_time_stepping_gives_their_impulse_too():
    model = slider(PULSE, parameters={"a": 0.3, "w": 1e-3, "f": 3e3}).edit("s", limits=[(-9, 9)])
    run = pg.simulate(model, t_end=1.0, method="moreau_jean", step=0.02)
    assert np.isclose(run.v[-1, 0], 1.5, rtol=1e-9)
    assert np.isclose(run.q[-1, 0], 1.5 * (0.7 - 0.5e-3), rtol=1e-9)


CONTROLS = {
    "rate": pg.State(name="c", rate="=if(t > a and t < a + w, f, 0)"),
    "input": pg.Filter(name="c", input="=if(t > a and t < a + w, f, 0)", lag=0.5),
    "setpoint": pg.PID(name="c", signal=0.0, setpoint="=if(t > a and t < a + w, f, 0)", ki=1.0),
}


@pytest.mark.parametrize(("of", "how"), combined(CONTROLS, HOW))
def test_jumps_in_rates_inputs_and_setpoints_of_controls_end_steps(of, how):
    a, w, f = 0.3, 1e-3, 1e3
    model = slider(0.0, controls=[CONTROLS[of]], parameters={"a": a, "w": w, "f": f})
    run = pg.simulate(model, t_end=1.0, **HOW[how])
    exact = 1.0
    if of == "input":
        exact = f * (1 - np.exp(-w / 0.5)) * np.exp(-(1 - a - w) / 0.5)
    order = 5e-2 if how == "semi_implicit_euler" and of == "input" else 1e-6
    assert abs(run.states[-1, 0] - exact) < order


def test_a_square_wave_has_its_closed_form():
    run = pg.simulate(slider("=if(sin(20*pi*t) > 0, 2, -2)"), t_end=1.0, method="rk4", step=0.03)
    assert abs(run.v[-1, 0]) < 1e-12
    assert np.isclose(run.q[-1, 0], 0.5 * 0.05, rtol=1e-9)


def test_the_estimate_is_that_of_the_pieces():
    """Pieces between edges are shorter than steps, and a finer run divides them too."""
    text = "=if(sin(20*pi*t) > 0, 1, -1)*cos(90*t)"
    for how in ({"method": "rk4", "step": 0.2}, {"method": "dopri5", "rtol": 1e-3}):
        run = pg.simulate(slider(text), t_end=1.0, **how)
        exact = pg.simulate(slider(text), t_end=1.0, method="dop853", rtol=1e-12)
        off = abs(run.q[-1, 0] - exact.q[-1, 0])
        assert 0.2 * off < run.error_estimate + 1e-12


@pytest.mark.parametrize("method", ["rk4", "gauss6"])
def test_runs_steppers_batches_and_sweeps_have_the_same_bits(method):
    model = slider(PULSE, parameters={"a": 0.31, "w": 0.003, "f": 50.0})
    call = {"step": 1e-2, "method": method}
    run = pg.simulate(model, t_end=1.0, frames=101, **call)
    stepper = pg.Stepper(pg.Mechanism(model), **call)
    stepper.step(n=100)
    assert np.array_equal(stepper.q, run.q[-1])
    values = [0.31, 0.4, 0.717]
    batch = pg.BatchStepper(pg.Mechanism(model), 3, set={"a": values}, **call)
    batch.step(n=100)
    metric = {"last": lambda run: float(run.q[-1, 0])}
    swept = pg.sweep(model, {"a": values}, metric, t_end=1.0, **call)
    for i, a in enumerate(values):
        other = pg.simulate(slider(PULSE, parameters={"a": a, "w": 0.003, "f": 50.0}), t_end=1.0,
                            frames=101, **call)  # fmt: skip
        assert np.array_equal(batch.q[i], other.q[-1])
        assert np.isclose(batch.v[i, 0], 0.075, rtol=1e-9)
        assert swept["last"][i] == other.q[-1, 0]


def test_frames_at_an_edge_and_a_start_at_one():
    text = "=if(t >= 0.25, 4, 0)"
    run = pg.simulate(slider(text), t_end=0.5, t_eval=[0.0, 0.25, 0.5], rtol=1e-8)
    assert run.vdot[:, 0].tolist() == [0.0, 2.0, 2.0]
    late = pg.simulate(slider(text), t_start=0.25, t_end=0.5, method="rk4", step=0.01)
    assert np.isclose(late.v[-1, 0], 0.5)
    early = pg.simulate(slider("=if(t > 0, 4, 0)"), t_end=0.5, method="rk4", step=0.01)
    assert np.isclose(early.v[-1, 0], 1.0)


def test_a_motion_has_the_edges_of_its_expression():
    body = pg.Body(name="s", joint="prismatic", axes=[X], mass=2.0)
    text = "=0.1*smoothstep(t, 0.3001, 0.3002)"
    motion = pg.Motion(name="m", body="s", q_of_t=text)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0), constraints=[motion])
    run = pg.simulate(model, t_end=0.5, rtol=1e-8)
    assert np.isclose(run.q[-1, 0], 0.1)
    assert not any("jumps" in text for text in run.notices)

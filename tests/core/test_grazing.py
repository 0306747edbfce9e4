"""Events that hardly happen: limits at grazing speed, thresholds just below an amplitude."""

import math

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

WAYS = [
    {},
    {"method": "dopri5", "rtol": 1e-4},
    {"method": "dopri5", "rtol": 1e-8},
    {"method": "dop853", "rtol": 1e-10},
]
SWITCHED = [
    {},
    {"method": "radau5", "step": 0.05},
    {"method": "rk4", "step": 0.02},
    {"method": "radau5", "rtol": 1e-6},
    {"method": "dopri5", "rtol": 1e-4},
    {"method": "semi_implicit_euler", "step": 1e-3},
]
SHORT = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12]  # of the amplitude


def label(value):
    return "-".join(map(str, value.values())) or "default" if isinstance(value, dict) else None


def oscillator(frequency=1.0, **fields):
    """x = sin(frequency t)."""
    return pg.Body(
        name="b", joint="prismatic", axes=((1, 0, 0),), stiffness=(frequency**2,), v=(frequency,),
        **fields,
    )  # fmt: skip


def right_or_told(run, exact):
    error = float(np.abs(run.q - exact).max())
    return error < 10 * run.error_estimate or any("not decided" in text for text in run.notices)


@pytest.mark.parametrize(
    ("short", "options", "restitution", "frequency"),
    combined(SHORT, WAYS, [0.0, 0.5, 1.0], [1.0, 7.0]),
    ids=label,
)
def test_a_limit_that_is_reached_at_grazing_speed(options, short, restitution, frequency):
    """The speed is sqrt(2 short) of the largest one. The way back is a sine from there."""
    limit = 1.0 - short
    body = oscillator(frequency, limits=((None, limit),), limit_restitution=(restitution,))
    run = pg.simulate(pg.Model(bodies=(body,), gravity=(0, 0, 0)), t_end=4.0 / frequency, **options)
    s = frequency * run.t
    hit = math.asin(limit)
    back = limit * np.cos(s - hit) - restitution * math.cos(hit) * np.sin(s - hit)
    assert right_or_told(run, np.where(s < hit, np.sin(s), back)[:, None])


@pytest.mark.parametrize(("options", "short"), combined(SWITCHED, SHORT), ids=str)
def test_a_switch_whose_threshold_is_just_below_the_amplitude(options, short):
    """A latch that holds the slider where it goes on."""
    threshold = 1.0 - short
    latch = pg.Weld(name="latch", body="b", active=False)
    switch = pg.Switch(
        constraint="latch", active=True, when={"coordinate": "b", "above": threshold}
    )
    model = pg.Model(bodies=(oscillator(),), constraints=(latch,), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=4.0, switches=[switch], **options)
    exact = np.where(run.t < math.asin(threshold), np.sin(run.t), threshold)[:, None]
    assert right_or_told(run, exact)


@pytest.mark.parametrize(
    ("short", "options"), combined([*SHORT, *(-x for x in SHORT)], SWITCHED), ids=label
)
def test_an_event_at_the_amplitude_is_found_or_told(options, short):
    """It happens where `short` is positive."""

    def crosses(t, q, v):
        return q[0] - (1.0 - short)

    model = pg.Model(bodies=(oscillator(),), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=4.0, events=[crosses], **options)
    times = [event.t for event in run.user_events]
    told = any("not decided" in text for text in run.notices)
    apart = math.acos(min(1.0 - short, 1.0))
    near = [math.pi / 2 - apart, math.pi / 2 + apart] if short > 0.0 else []
    slack = 10 * run.error_estimate / max(math.sin(apart), 1e-300)
    off = np.subtract(times, near) if len(times) == len(near) else [np.inf]
    assert told or np.abs(off).max(initial=0.0) < slack + 1e-9
    assert not told or abs(short) < 1e-2


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-9}], ids=label)
def test_what_stays_clear_is_not_told(options):
    """A limit and a threshold a thousandth beyond the amplitude."""
    body = oscillator(limits=((None, 1.001),))
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=20.0, events=[lambda t, q, v: q[0] - 1.002], **options)
    assert not any("not decided" in text for text in run.notices)
    assert not run.user_events


WIDE = [{"method": "gauss6", "step": step} for step in (0.05, 0.1, 0.2, 0.3)]


@pytest.mark.parametrize(
    ("short", "options"), combined([*SHORT, *(-x for x in SHORT)], [*SWITCHED, *WIDE]), ids=label
)
def test_a_comparison_at_the_turning_point_is_met_or_told(options, short):
    """The spring is gone beyond a threshold, which is met where `short` is positive."""
    threshold = 1.0 - short
    motor = pg.Motor(name="f", body="b", torque=f"=if(q.b > {threshold!r}, 1*q.b, 0)")
    model = pg.Model(bodies=(oscillator(),), gravity=(0, 0, 0), forces=(motor,))
    run = pg.simulate(model, t_end=3.0, **options)
    exact = np.sin(run.t)
    if short > 0.0:
        met = math.asin(threshold)
        exact = np.where(run.t < met, exact, threshold + math.cos(met) * (run.t - met))
    told = [text for text in run.notices if "not decided" in text]
    assert right_or_told(run, exact[:, None])
    assert all("'f'" in text for text in told)
    assert not told or abs(short) < 1e-2


@pytest.mark.parametrize("parts", [317, 1000])
def test_a_comparison_met_by_an_error_of_first_order_is_told(parts):
    """The largest way is h^2/8 too long with semi-implicit Euler."""
    step = 6.0 / parts
    motor = pg.Motor(name="f", body="b", torque=f"=if(q.b > {1.0 + step**2 / 40!r}, 1*q.b, 0)")
    model = pg.Model(bodies=(oscillator(),), gravity=(0, 0, 0), forces=(motor,))
    run = pg.simulate(model, t_end=6.0, step=step, method="semi_implicit_euler")
    assert right_or_told(run, np.sin(run.t)[:, None])


@pytest.mark.parametrize("options", [{}, {"method": "dopri5", "rtol": 1e-6}], ids=label)
def test_a_threshold_that_ends_a_slide_is_not_told(options):
    """The mass slides along a speed until the way has a force, well beyond its error."""
    text = "=if(v.b > 0.02, -0.84, 0) + if(sin(29*q.b) > 0.85, 0.97, 0)"
    body = pg.Body(name="b", joint="prismatic", stiffness=(1.0,), damping=(0.1,), q=(0.33,))
    motor = pg.Motor(name="f", body="b", torque=text)
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0), forces=(motor,))
    run = pg.simulate(model, t_end=2.9, frames=31, **options)
    assert not any("not decided" in text for text in run.notices)


@pytest.mark.parametrize(
    ("limit", "options"),
    combined(
        [0.1, 0.2, 0.6, 3.0],
        [{}, {"method": "radau5", "rtol": 1e-6}, {"method": "rk4", "step": 0.01}],
    ),
    ids=str,
)
def test_an_integral_that_rests_at_its_bound_is_not_told(limit, options):
    """The state of a clamped PID stays at its bound, up to rounding, and leaves it later."""
    body = pg.Body(name="b", axes=((0, 0, 1),), inertia=(1, 1, 1), v=[0.4])
    gains = {"kp": 12.0, "ki": 4.0, "kd": 2.0, "filter": 0.05, "setpoint": 1.3}
    pid = pg.PID(name="c", signal="=q.b", low=-limit, high=limit, **gains)
    motor = pg.Motor(name="f", body="b", torque="=x.c")
    run = pg.simulate(
        pg.Model(bodies=(body,), forces=(motor,), controls=(pid,)), t_end=4.0, **options
    )
    assert run.status.ok
    assert not any("not decided" in text for text in run.notices)

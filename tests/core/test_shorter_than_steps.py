"""Features shorter than a step: spikes and corners of tables, and inputs with a lag."""

import math

import mpmath
import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import box, on_ground

EPS = np.finfo(float).eps
STEPS = {
    "semi_implicit_euler": 0.01, "rk4": 0.01, "dopri5": 0.05, "dop853": 0.05, "gauss6": 0.05,
    "radau5": 0.05,
}  # fmt: skip
FIXED = [
    pytest.param({"method": method, "step": step}, id=method) for method, step in STEPS.items()
]
CHOSEN = [
    pytest.param({}, id="default"),
    pytest.param({"method": "radau5", "rtol": 1e-8}, id="rtol"),
]


def slider(*forces, mass=1.0, stiffness=0.0):
    body = pg.Body(
        name="b", joint="prismatic", axes=((1, 0, 0),), mass=mass, stiffness=(stiffness,)
    )
    return pg.Mechanism(pg.Model(bodies=(body,), forces=forces, gravity=(0, 0, 0)))


def motor(t, value, **fields):
    return pg.Motor(name="f", body="b", torque=pg.Table(t=t, value=value), **fields)


# -- spikes ----------------------------------------------------------------------------------------


def spike(begin, width, impulse):
    """Times and values of a triangle."""
    return (begin, begin + width / 2, begin + width), (0.0, 2.0 * impulse / width, 0.0)


def wide(t):
    """The width of a triangle as its rounded times have it."""
    return t[2] - t[0]


@pytest.mark.parametrize("options", FIXED + CHOSEN)
@pytest.mark.parametrize("width", [1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("begin", [0.5, 0.503, 0.7 - 1e-10])
def test_a_spike_of_a_table_is_never_passed_over(options, width, begin):
    """x = impulse / mass x time since, but for the roundings of times within the spike.

    Euler's method takes each side of the triangle, or part of it, for its first value.
    """
    t, value = spike(begin, width, -3.0)
    run = pg.simulate(slider(motor(t, value), mass=2.0), t_end=1.0, estimate=False, **options)
    impulse = 0.5 * value[1] * wide(t)
    euler = options.get("method") == "semi_implicit_euler" and begin > 0.6
    slack = 1.0 if euler else 16 * EPS * 3.0 / width + 1e-9
    assert run.q[-1, 0] == pytest.approx(impulse / 2.0 * (1.0 - t[1]), abs=slack + 3.0 * width)
    assert run.v[-1, 0] == pytest.approx(impulse / 2.0, abs=slack)


@pytest.mark.parametrize("options", FIXED)
def test_spikes_of_forces_and_motions_are_seen_too(options):
    t, value = spike(0.5, 1e-6, 1.0)
    table = pg.VectorTable(t=t, value=tuple((x, 0.0, 0.0) for x in value))
    run = pg.simulate(slider(pg.Wrench(name="w", body="b", force=table)), t_end=1.0, **options)
    assert run.v[-1, 0] == pytest.approx(1.0, abs=1e-8)
    servo = pg.Servo(name="f", body="b", kp=1.0, target=pg.Table(t=t, value=value))
    run = pg.simulate(slider(servo), t_end=1.0, **options)
    x, v = math.sin(0.5), math.cos(0.5)
    order = 1e-2 if options["method"] == "semi_implicit_euler" else 1e-3
    assert run.q[-1, 0] == pytest.approx(x, abs=order)
    assert run.v[-1, 0] == pytest.approx(v, abs=order)


@pytest.mark.parametrize("options", FIXED)
def test_two_spikes_in_one_step(options):
    """Up in the first, down in the second: x is their distance in time."""
    t, value = (0.501, 0.5012, 0.5014, 0.505, 0.5052, 0.5054), (0.0, 5e3, 0.0, 0.0, -5e3, 0.0)
    run = pg.simulate(slider(motor(t, value)), t_end=1.0, estimate=False, **options)
    assert run.q[-1, 0] == pytest.approx(0.004, abs=2e-4)
    assert run.v[-1, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("at", [0.3, 0.30000000000000004, 0.29999999999999993, 0.1 + 0.2])
@pytest.mark.parametrize("step", [0.01, 0.02, 0.1])
def test_a_corner_within_rounding_of_a_steps_end_is_there(at, step):
    """No step is made for what rounding parts, and a jump there acts from there on."""
    t, value = (at, at + 1e-12), (0.0, 1.0)
    run = pg.simulate(slider(motor(t, value)), t_end=1.0, step=step, method="rk4", estimate=False)
    assert run.counters["steps"] == round(1.0 / step) + 1
    assert run.v[-1, 0] == pytest.approx(1.0 - at, abs=1e-11)


@pytest.mark.parametrize(
    ("method", "order"),
    [("semi_implicit_euler", 1), ("rk4", 4), ("gauss6", 4), ("radau5", 5),
     ("dopri5", 5)],
)  # fmt: skip
def test_the_order_is_kept_where_tables_bend_inside_steps(method, order):
    """x'' = -x + F with F = 0 until a, then t - a, then constant from b on."""
    a, b = 0.3123, 0.7071
    mech = slider(motor((a, b), (0.0, b - a)), stiffness=1.0)

    def ramp(s):
        return s - np.sin(s) if s > 0 else 0.0

    exact = ramp(2.0 - a) - ramp(2.0 - b)
    errors = [
        abs(pg.simulate(mech, t_end=2.0, step=h, method=method, estimate=False).q[-1, 0] - exact)
        for h in (0.1, 0.05, 0.025)
    ]
    assert errors[2] < 1e-13 or errors[0] > errors[2] * 0.4 * 4.0**order


@pytest.mark.parametrize(
    ("fields", "bend"),
    [
        ({"torque": pg.Table(t=(0.0, 1.0), value=(0.0, 3.0)), "torque_limit": 1.0}, "clip"),
        ({"torque": 3.0, "integrates": True, "state_high": 1.0}, "full"),
    ],
)
def test_bounds_of_an_input_bend_it_like_a_knot(fields, bend):
    """3 t up to 1 N, which is reached at t = 1/3: rk4 is exact on both sides."""
    mech = slider(pg.Motor(name="f", body="b", **fields))
    run = pg.simulate(mech, t_end=1.0, step=0.1, method="rk4", estimate=False)
    third = 1.0 / 3.0
    v, x = 0.5 * third, 0.5 * third**2
    left = 1.0 - third
    x = 0.5 * third**3 + v * left + 0.5 * left**2
    assert run.v[-1, 0] == pytest.approx(v + left, abs=1e-14)
    assert run.q[-1, 0] == pytest.approx(x, abs=1e-14)


def test_recorded_times_stay_as_asked():
    """Steps end at corners that no frame shows."""
    mech, asked = slider(motor((0.111, 0.222, 0.333), (0.0, 1.0, 0.0))), [0.0, 0.1, 0.25, 1.0]
    for options in ({"step": 0.01, "method": "rk4"}, {"step": 0.05, "method": "radau5"}, {}):
        assert np.array_equal(pg.simulate(mech, t_end=1.0, t_eval=asked, **options).t, asked)
    plain = pg.simulate(slider(), t_end=1.0, step=0.01, method="rk4")
    assert np.array_equal(pg.simulate(mech, t_end=1.0, step=0.01, method="rk4").t, plain.t)


@pytest.mark.parametrize("options", FIXED + CHOSEN)
@pytest.mark.parametrize("width", [2e-4, 1e-6, 1e-9])
def test_the_estimate_sees_what_is_shorter_than_a_step(options, width):
    """A saw tooth, whose rise and fall a method of low order takes for different impulses."""
    t, value = (0.5, 0.5 + 0.1 * width, 0.5 + width), (0.0, 2.0 / width, 0.0)
    run = pg.simulate(slider(motor(t, value)), t_end=1.0, **options)
    impulse = 0.5 * value[1] * (t[2] - t[0])
    exact = impulse * (1.0 - sum(t) / 3.0)
    assert abs(run.q[-1, 0] - exact) < 10 * run.error_estimate + 1e-12


@pytest.mark.parametrize(
    ("seed", "text", "parts"), combined(range(4), [False, True], [100, 317, 1000]), ids=str
)
def test_every_step_of_the_finer_run_is_half_of_one(seed, text, parts):
    """Then the estimate of a method of order one is half the error, beside corners too."""
    rng, total = np.random.default_rng(seed), 10.0 ** np.random.default_rng(seed).uniform(-2, 2)
    steps = rng.exponential(size=12) * 10.0 ** rng.uniform(-2, 0, 12)
    t = total * np.append(0.0, np.cumsum(steps)) / steps.sum()
    value = rng.normal(size=13) / total**2
    torque = pg.Table(t=t.tolist(), value=value.tolist())
    if text:
        knots = ", ".join(f"{a!r}, {b!r}" for a, b in zip(t.tolist(), value.tolist()))
        torque = f"=table(t, {knots})"
    mech = slider(pg.Motor(name="f", body="b", torque=torque))
    given = {"t_end": total, "frames": 101}
    exact = pg.simulate(mech, rtol=1e-12, method="dop853", **given)
    run = pg.simulate(mech, method="semi_implicit_euler", step=total / parts, **given)
    error = abs(run.q - exact.q).max()
    assert run.error_estimate == pytest.approx(0.5 * error, rel=0.02)


@pytest.mark.parametrize(
    ("late", "width", "impulse", "options"),
    combined([0.0, 1e3], [1e-6, 1e-11], [1e-6, 1.0, 1e6], [{}, {"method": "rk4", "step": 0.01}]),
)
def test_the_estimate_counts_the_rounding_of_the_times_of_spikes(late, width, impulse, options):
    """An impulse in a time that is known to rounding only, and late in a run."""
    width = max(width, 1e-12 * late)
    knots = late + np.array([0.3, 0.3 + 0.4 * width, 0.3 + width])
    rounded = knots - late
    run = pg.simulate(
        slider(motor(tuple(knots.tolist()), (0.0, 2.0 * impulse / width, 0.0))),
        t_start=late, t_end=late + 1.0, **options,
    )  # fmt: skip
    exact = impulse / width * (rounded[2] - rounded[0]) * (1.0 - rounded.sum() / 3.0)
    off = abs(run.q[-1, 0] - exact)
    assert off < 10 * run.error_estimate
    assert run.error_estimate < 100 * np.finfo(float).eps * (1 + late) * impulse / width


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4", "gauss6"])
def test_a_stepper_meets_spikes(method):
    """The bits are those of `simulate` for any number of steps at once."""
    t, value = spike(0.0123, 1e-7, 1.0)
    mech, step = slider(motor(t, value)), 0.01
    run = pg.simulate(mech, t_end=0.05, step=step, method=method, estimate=False)
    st = pg.Stepper(mech, method=method, step=step)
    for n in (1, 3, 1):
        st.step(n=n)
    assert st.v[0] == pytest.approx(1.0, abs=1e-6)
    assert st.q[0] == pytest.approx(run.q[-1, 0], abs=1e-12)


# -- lags ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", FIXED + CHOSEN)
@pytest.mark.parametrize("lag", [1e-6, 1e-4, 1e-2, 1.0])
def test_a_lag_shorter_than_the_step_is_resolved(options, lag):
    """A constant motor from rest gives v = t - lag (1 - exp(-t / lag)), 1 N x lag less impulse.

    No step is wider than half of a lag when the transient begins, which gives a method of first
    order the size of its impulse, and the others its value.
    """
    mech = slider(pg.Motor(name="f", body="b", torque=1.0, lag=lag, start=0.0))
    run = pg.simulate(mech, t_end=0.5, **options)
    t = run.t[-1]
    v = t + lag * math.expm1(-t / lag)
    x = t * t / 2 - lag * t - lag * lag * math.expm1(-t / lag)
    err = abs(run.v[-1, 0] - v)
    first = options.get("method") == "semi_implicit_euler"
    assert err < (0.7 if first else 0.05) * min(lag, options.get("step", 1.0))
    own = 0.5 * options.get("step", 0.0) * t if first else 0.0  # of Euler's steps without a lag
    assert abs(run.q[-1, 0] - x) < 10 * max(run.error_estimate, own) + 1e-12


@pytest.mark.parametrize("options", FIXED + CHOSEN)
@pytest.mark.parametrize("width", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_lag_after_a_jump_of_its_table(options, width):
    """To the time's rounding within the jump, whose mean is what acts later."""
    lag, begin = 1.0, 0.3
    t = (0.0, begin, begin + width)
    run = pg.simulate(slider(motor(t, (0.0, 0.0, 1.0), lag=lag)), t_end=1.0, **options)
    s, w = run.t[-1] - 0.5 * (t[1] + t[2]), t[2] - t[1]
    sinhc = math.sinh(0.5 * w / lag) / (0.5 * w / lag)
    x = 0.5 * s * s + w * w / 24 - lag * s + lag * lag * (1.0 - math.exp(-s / lag) * sinhc)
    assert abs(run.q[-1, 0] - x) < 10 * run.error_estimate + 1e-10


def test_the_closed_form_of_a_lag_cancels_nowhere():
    """y of y' = (u + slope s - y) / lag over twelve decades of lag, slope and time."""
    from pgraph_core.engine.drives import followed

    rng = np.random.default_rng(3)
    with mpmath.workdps(60):
        for _ in range(3000):
            lag, ahead = 10.0 ** rng.uniform(-6, 6, 2)
            slope = 10.0 ** rng.uniform(-6, 6)
            y, u = rng.choice([0.0, 1.0, rng.normal()]), rng.choice([0.0, 1.0, rng.normal()])
            rise, lags = slope * ahead, ahead / lag
            z = mpmath.mpf(lags)
            left = mpmath.exp(-z)
            parts = u * (1 - left), y * left, mpmath.mpf(rise) * (1 - (1 - left) / z)
            size = float(sum(map(abs, parts)))
            assert abs(float(sum(parts)) - followed(y, u, rise, lags)) <= 8 * EPS * size


@pytest.mark.parametrize("lag", [1e-5, 3e-3])
@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4", "gauss6"])
def test_a_new_input_of_a_stepper_follows_with_its_lag(lag, method):
    """From 0 to 1 N at t = 0.1: what is missing of the impulse is 1 N x lag."""
    mech = slider(pg.Motor(name="f", body="b", torque=0.0, lag=lag))
    st = pg.Stepper(mech, method=method, step=0.01)
    st.step(n=10)
    st.input("f", 1.0)
    st.step(n=40)
    low = method == "semi_implicit_euler"
    assert st.v[0] == pytest.approx(0.4 - lag, abs=0.7 * lag if low else 0.05 * lag)


@pytest.mark.parametrize("lag", [0.0, 1e-4])
def test_instances_of_a_batch_meet_spikes(lag):
    """The steps before, at and after the spike are those of single runs, in lanes too."""
    t, value = spike(0.0123, 1e-6, 1.0)
    mech = slider(motor(t, value, lag=lag))
    many = pg.BatchStepper(mech, 9, method="rk4", step=0.01)
    one = pg.Stepper(mech, method="rk4", step=0.01)
    for n in (1, 2, 3):
        many.step(n=n)
        one.step(n=n)
        np.testing.assert_allclose(many.v, np.tile(one.v, (9, 1)), rtol=1e-12)
    assert one.v[0] == pytest.approx(1.0, abs=1e-5 if lag == 0.0 else 0.05)


@pytest.mark.parametrize("begin", [0.5, 0.5034])
@pytest.mark.parametrize("width", [1e-9, 1e-5])
def test_time_stepping_meets_spikes(begin, width):
    """A box without friction on the ground, and one that a limit stops later."""
    t, value = spike(begin, width, 1.0)
    table = pg.VectorTable(t=t, value=tuple((x, 0.0, 0.0) for x in value))
    model = on_ground(box(), friction=0.0)
    model = model.replace(forces=(pg.Wrench(name="w", body="b", force=table),))
    run = pg.simulate(model, t_end=1.0, step=0.01, estimate=False)
    assert run.v[-1, 3] == pytest.approx(1.0, abs=1e-5)
    assert run.q[-1, 2] == pytest.approx(0.0, abs=1e-6)
    body = pg.Body(
        name="b",
        joint="prismatic",
        axes=((1, 0, 0),),
        limits=((None, 0.2),),
        limit_restitution=(1.0,),
    )
    model = pg.Model(bodies=(body,), forces=(motor(t, value),), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=1.0, step=0.01, estimate=False)
    assert run.q[-1, 0] == pytest.approx(0.4 - (1.0 - t[1]), abs=1e-5)

"""Steps end where a force bends or jumps: knots of dampers, touches of soft contacts."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..worlds import built_in

W = 2.0  # rad/s of the oscillator


def oscillator(*forces, q=1.0, **fields):
    body = pg.Body(
        name="c", joint="prismatic", axes=((1, 0, 0),), mass=1.0, q=(q,), stiffness=W * W, **fields
    )
    return pg.Model(bodies=(body,), gravity=(0, 0, 0), forces=forces)


def valve(first, slope):
    """A damper that begins to act beyond a speed, to a point so far that it does not turn."""
    lines = pg.Lines(x=(-1, first, first + 1), value=(0, 0, slope))
    ends = {"point": (0, 0, 0), "other_point": (-50, 0, 0)}
    return pg.Strut(name="s", body="c", damper=lines, **ends)


@pytest.mark.parametrize("options", [{}, {"method": "radau5", "rtol": 1e-6}, {"rtol": 1e-4}])
@pytest.mark.parametrize("short", [1e-2, 1e-3, 1e-4])
def test_a_damper_that_acts_at_the_peaks_of_speed_only_is_not_missed(short, options):
    """The same law as an expression, whose comparisons end steps."""
    first = W * (1.0 - short)
    t = np.linspace(0.0, 9.0, 31)
    text = f"=-300*max(v.c - {first}, 0)"
    strut = pg.simulate(oscillator(valve(first, 300.0)), t_eval=t, **options)
    law = pg.simulate(oscillator(pg.Motor(name="m", body="c", torque=text)), t_eval=t, rtol=1e-11)
    assert np.abs(strut["c"] - law["c"]).max() < 10.0 * strut.error_estimate + 1e-9


def test_a_servo_with_a_lag_reaches_its_limit_within_a_step():
    """Its input bends, and so does the distance to the limit."""
    lag = {"lag": 0.2, "kp": 40.0, "kd": 1.0, "torque_limit": 7.0}
    servo = pg.Servo(name="m", body="c", target=pg.Table(t=(0, 1), value=(0, 1)), **lag)
    coarse = pg.simulate(oscillator(servo), t_end=4.0, rtol=1e-5)
    fine = pg.simulate(oscillator(servo), t_end=4.0, rtol=1e-11)
    assert np.abs(coarse["c"] - fine["c"]).max() < 10.0 * coarse.error_estimate


# -- contacts --------------------------------------------------------------------------------------

G, R, DROP = 9.81, 0.1, 0.3


def ball(law, **fields):
    body = pg.Body(
        name="b", joint="free", mass=1.0, inertia=(4e-3,) * 3, q=(0, 0, R + DROP, 1, 0, 0, 0),
        shape=pg.Shape(kind="sphere", radius=R),
    )  # fmt: skip
    floor = pg.Contact(name="f", body="b", law=law, friction=0.0, **fields)
    return pg.Model(bodies=(body,), contacts=(floor,), gravity=(0, 0, -G))


def in_contact(stiffness, damping, t):
    """x'' = -g - k x - c x' from x = 0 with the speed of the fall, as long as it pushes."""
    fall = np.sqrt(2.0 * DROP / G)
    late, loss = t - fall, 0.5 * damping
    w = np.sqrt(stiffness - loss * loss)
    rest = -G / stiffness
    a, b = -rest, (-G * fall - rest * loss) / w
    return rest + np.exp(-loss * late) * (a * np.cos(w * late) + b * np.sin(w * late))


@pytest.mark.parametrize(
    ("share", "options"),
    combined([0.05, 0.2, 0.9], [{}, {"method": "rk4", "step": 3e-4}, {"rtol": 1e-9}]),
)
def test_the_damper_of_a_penalty_contact_jumps_at_the_end_of_a_step(share, options):
    """Its closed form until the deepest point. Steps of order 4 keep their digits."""
    stiffness = 9810.0
    damping = share * 2.0 * np.sqrt(stiffness)
    fall, t_end = np.sqrt(2.0 * DROP / G), np.sqrt(2.0 * DROP / G) + 1.0 / np.sqrt(stiffness)
    t = np.linspace(fall, t_end, 30)
    model = ball("penalty", stiffness=stiffness, damping=damping)
    run = pg.simulate(model, t_eval=t, **options)
    error = np.abs(run["b.2"] - R - in_contact(stiffness, damping, t)).max()
    assert error < 2e-8
    assert error < 10.0 * run.error_estimate + 1e-11


@pytest.mark.parametrize("step", [1e-3, 4.7e-4, 2.5e-4])
def test_a_step_of_order_4_that_begins_at_the_touch_has_no_error_of_the_touch(step):
    """A jump within a step of 1 ms makes an error of 1e-6 m that depends on chance."""
    stiffness, damping = 9810.0, 40.0
    t = np.linspace(0.25, 0.255, 6)
    model = ball("penalty", stiffness=stiffness, damping=damping)
    run = pg.simulate(model, t_eval=t, method="rk4", step=step)
    assert np.abs(run["b.2"] - R - in_contact(stiffness, damping, t)).max() < 1e-10


def test_a_box_that_lands_on_a_corner_ends_a_step_at_each():
    """Corners of a box over the ground touch one after another."""
    body = pg.Body(
        name="b", joint="free", mass=1.0, inertia=(2e-3,) * 3, q=(0, 0, 0.2, 0.98, 0.1, 0.17, 0),
        shape=pg.Shape(kind="box", size=(0.1, 0.1, 0.1)),
    )  # fmt: skip
    given = {"law": "penalty", "stiffness": 5e4, "damping": 60.0, "friction": 0.3}
    model = pg.Model(bodies=(body,), contacts=(pg.Contact(name="f", body="b", **given),))
    coarse = pg.simulate(model, t_end=0.3)
    fine = pg.simulate(model, t_end=0.3, step=2e-5, estimate=False)
    error = np.abs(coarse.q[-1] - fine.q[-1]).max()
    assert error < 10.0 * coarse.error_estimate


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_contacts_that_touch_at_the_start_push_at_once(law):
    """A ball that starts 1 mm deep: the same with the default and with much smaller steps."""
    stiffness = 1e6 if law == "soft" else 5e4  # N/m^1.5, N/m
    model = ball(law, stiffness=stiffness, damping=1.0).edit("b", q=(0, 0, R - 1e-3, 1, 0, 0, 0))
    run = pg.simulate(model, t_end=0.02)
    assert run.vdot[0, 5] > 10.0
    fine = pg.simulate(model, t_end=0.02, step=1e-5, estimate=False)
    assert abs(run["b.2"][-1] - fine["b.2"][-1]) < 1e-7


def resting(law, gap, speed=0.0, size=1.0, mass=1.0, **given):
    body = pg.Body(
        name="b", joint="free", mass=mass, inertia=(mass * size * size / 6,) * 3,
        q=(0, 0, 0.5 * size + gap, 1, 0, 0, 0), v=(0, 0, 0, 0, 0, speed),
        shape=pg.Shape(kind="box", size=(size,) * 3),
    )  # fmt: skip
    return pg.Model(bodies=(body,), contacts=(pg.Contact(name="f", body="b", law=law, **given),))


METHODS = "rk4", "dopri5", "dop853", "semi_implicit_euler", "gauss6", "radau5", "moreau_jean"


@pytest.mark.parametrize(
    ("law", "method", "step", "gap", "speed"),
    combined(
        ["penalty", "soft"],
        METHODS,
        [0.05, 0.1, 0.02],
        [0.0, 1e-9, -1e-9, -1e-5, 1e-4],
        [0.0, 1.0, -1.0],
    ),
)
def test_a_run_that_begins_at_a_touch_takes_no_energy_from_wide_steps(
    law, method, step, gap, speed
):
    """A contact with losses only takes energy. At the start its springs hold what 1e-5 m hold."""
    model = resting(law, gap, speed)
    stored = 9.81 * 1e-4 if gap < 0.0 else 0.0  # J: four springs whose rest is at 1e-5 m
    run = pg.simulate(model, t_end=0.1, method=method, step=step, estimate=False)
    energy = run.energy - run.energy[0]
    assert energy.max() < stored + 1e-3 * max(9.81 * 0.5, 0.5 * speed**2)


@pytest.mark.parametrize("law", ["penalty", "soft"])
@pytest.mark.parametrize(("size", "mass"), [(0.05, 1e-3), (1.0, 1.0), (4.0, 1e3)])
def test_a_box_that_touches_comes_to_rest_at_any_size(law, size, mass):
    model = resting(law, 0.0, size=size, mass=mass)
    run = pg.simulate(model, t_end=0.1, method="rk4", step=0.05, estimate=False)
    assert np.abs(run.q[:, 2] - 0.5 * size).max() < 1e-3 * size
    assert abs(run.v[-1, 5]) < 1e-2 * np.sqrt(9.81 * size)


@pytest.mark.parametrize("law", ["penalty", "soft"])
def test_a_force_that_begins_on_a_body_at_rest_throws_it_no_more(law):
    """Without gravity nothing but the torques of a step presses the box into the ground."""
    model = resting(law, 0.0, stiffness=1e6, damping=10.0, friction=0.0).replace(gravity=(0, 0, 0))
    stepper = pg.Stepper(model, method="rk4", step=0.05)
    batch = pg.BatchStepper(model, 2, method="rk4", step=0.05)
    for push in (0.0, -20.0, -20.0, 0.0):
        tau = np.array((0, 0, 0, 0, 0, push))
        stepper.step(tau)
        batch.step(np.tile(tau, (2, 1)))
        assert np.array_equal(stepper.q, batch.q[1])
        assert abs(stepper.q[2] - 0.5) < 1e-2
    run = pg.simulate(model, t_end=0.05, method="rk4", step=0.05, tau=lambda t, q, v: tau)
    stepper.reset()
    stepper.step(tau)
    assert np.array_equal(run.q[-1], stepper.q)


# -- conditions that keep themselves at their threshold -------------------------------------------


def carts(condition, **fields):
    axis = {"joint": "prismatic", "axes": ((1, 0, 0),), "mass": 1.0}
    bodies = (pg.Body(name="a", v=(1.0,), **axis), pg.Body(name="b", q=(0.5,), **axis))
    held = pg.Velocity(name="w", coefficients={"a": [1.0], "b": [-1.0]}, active=False)
    closes = {"constraint": "w", "active": True, "when": {"holds": condition, **fields}}
    later = {"constraint": "w", "active": True, "after": 0.5}
    opens = {"constraint": "w", "active": False, "when": later}
    scenarios = (pg.Scenario(name="x", switches=(closes, opens)),)
    given = {"constraints": (held,), "scenarios": scenarios, "gravity": (0, 0, 0)}
    return pg.Model(bodies=bodies, **given)


@pytest.mark.parametrize(
    ("gap", "once", "options"),
    combined(
        [0.1, 0.07, 0.033], [True, False],
        [{}, {"method": "rk4", "step": 0.01}, {"rtol": 1e-6}],
    ),
)  # fmt: skip
def test_a_clutch_may_keep_the_motion_at_the_threshold_that_closed_it(gap, once, options):
    """Both move on with half the speed from the time of contact, and part with it."""
    model = carts(f"=q.a > q.b - {gap}", **({"once": True} if once else {}))
    run = pg.simulate(model, scenario="x", t_end=1.6, **options)
    met = 0.5 - gap
    assert abs(run["a"][-1] - met - 0.5 * (1.6 - met)) < 1e-9
    assert abs(run["b"][-1] - 0.5 - 0.5 * (1.6 - met)) < 1e-9
    assert run.counters["steps"] < 500
    assert [event.t for event in run.events[:1]] == pytest.approx([met], abs=1e-9)


# -- forces without digits, forces that are missed -------------------------------------------------


@pytest.mark.parametrize("size", [1e-150, 1e-170, 1e-200, 1e-300, 5e-324])
@pytest.mark.parametrize("options", [{"step": 0.1}, {"rtol": 1e-8}])
def test_forces_that_have_no_size_stop_no_run(size, options):
    force = pg.Motor(name="m", body="c", torque=f"={size}*sin(t)")
    body = pg.Body(name="c", joint="prismatic", axes=((1, 0, 0),), mass=1.0)
    model = pg.Model(bodies=(body,), gravity=(0, 0, 0), forces=(force,))
    run = pg.simulate(model, t_end=2.0, method="dop853", **options)
    assert run.status is pg.Status.DONE
    assert run.counters["steps"] < 100
    assert abs(run["c"][-1] - size * (2.0 - np.sin(2.0))) <= 1e-6 * size + 1e-300


def test_a_force_that_frames_see_and_steps_do_not_is_told():
    """A narrow well is passed in less than a step. Frames show its acceleration."""
    text = "=-40*(q.c - 0.3)/0.004*exp(-((q.c - 0.3)/0.004)^2)"
    model = oscillator(pg.Motor(name="well", body="c", torque=text))
    run = pg.simulate(model, t_end=20.0, rtol=1e-4, frames=3001)
    fine = pg.simulate(model, t_end=20.0, rtol=1e-11, estimate=False)
    missed = abs(run["c"][-1] - fine["c"][-1]) > 10.0 * run.error_estimate
    told = [text for text in run.notices if "shorter than the steps" in text and "'c'" in text]
    assert told or not missed


@pytest.mark.parametrize(
    ("name", "scenario"),
    [("quadruped", "stance"), ("spherical_pendulum", None), ("spherical_pendulum", "swing")],
)
def test_coordinates_that_only_have_errors_miss_no_force(name, scenario):
    """Motion in a plane leaves accelerations of 1e-7 and less in the other coordinates."""
    run = pg.simulate(built_in(name), scenario=scenario, t_end=1.0, estimate=False)
    assert not any("shorter than the steps" in text for text in run.notices)


def test_a_pulse_on_a_free_body_is_told_in_its_unit():
    """A narrow well of force along x is passed in less than a step."""
    text = "=-400*(q.c[3] - 0.3)/0.004*exp(-((q.c[3] - 0.3)/0.004)^2)"
    push = pg.Wrench(name="well", body="c", force=(text, 0.0, 0.0))
    still = {"mass": 1.0, "inertia": (0.1, 0.1, 0.1)}
    body = pg.Body(name="c", joint="free", v=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0), **still)
    model = pg.Model(bodies=(body,), gravity=(0.0, 0.0, 0.0), forces=(push,))
    run = pg.simulate(model, t_end=20.0, rtol=1e-4, frames=3001, estimate=False)
    told = [text for text in run.notices if "shorter than the steps" in text]
    assert len(told) == 1
    assert "m/s^2" in told[0]


# -- controllers and derivatives -------------------------------------------------------------------


def holding():
    """A controller of 100 Hz that holds its torque, with an integral."""
    kept = {"sum": 0.0, "u": 0.0, "next": 0.0}

    def control(t, q, v):
        if t >= kept["next"] - 1e-9:
            error = 1.0 - q[0]
            kept["sum"] += 0.3 * error
            kept["u"] = 40.0 * error + kept["sum"] - 4.0 * v[0]
            kept["next"] += 0.01
        return np.array([kept["u"]])

    return control


def test_a_controller_that_remembers_is_told():
    """Steps of given size call it at four stages each, of which one is ahead."""

    def told(tau, **options):
        run = pg.simulate(oscillator(), tau=tau, t_end=0.2, **options)
        return [text for text in run.notices if "remembers" in text]

    assert told(holding())
    assert told(holding(), rtol=1e-6)
    assert told(holding(), step=1e-3)
    assert not told(holding(), sample=0.01)
    assert not told(lambda t, q, v: -3.0 * v)


@pytest.mark.parametrize("gap", [0.32, 0.3203, 0.2])
def test_derivatives_beyond_an_impact_on_a_frame_raise_no_alarm(gap):
    """Equal elastic balls exchange their speeds, and the derivatives of both are 1."""

    def one(name, **fields):
        shape = pg.Shape(kind="sphere", radius=0.1)
        return pg.Body(name=name, joint="prismatic", axes=((1, 0, 0),), shape=shape, **fields)

    bodies = (one("a", v=(1.0,)), one("b", link=(0.2 + gap, 0, 0)))
    touch = pg.Contact(name="c", body="a", other="b", restitution=1.0, friction=0.0)
    model = pg.Model(bodies=bodies, contacts=(touch,), gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=1.0, wrt=["q.a", "v.a"])
    for path in ("q.a", "v.a"):
        assert abs(run.sensitivity(path)[-1][1] - 1.0) < 1e-9
    assert not [text for text in run.notices if "apart" in text]

"""Comparisons of the motion end steps, however narrow the part of the way is in which they hold."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

NONE = np.zeros((3, 3))
WAYS = {
    "default": {},
    "dopri5": {"method": "dopri5", "rtol": 1e-3},
    "dop853": {"method": "dop853", "rtol": 1e-12},
    "radau5": {"method": "radau5", "rtol": 1e-6},
    "rk4": {"method": "rk4", "step": 0.1},
    "given radau5": {"method": "radau5", "step": 0.5},
    "gauss6": {"method": "gauss6", "step": 0.2},
}


def mass(law, speed=1.0, **fields):
    """A mass of 1 kg that coasts along x from zero."""
    body = pg.Body(
        name="m", joint="prismatic", axes=((1, 0, 0),), mass=1.0, inertia=NONE, v=(speed,), **fields
    )
    motor = pg.Motor(name="f", body="m", torque=f"={law}")
    return pg.Model(bodies=(body,), gravity=(0, 0, 0), forces=(motor,))


def through(t, a, b, f):
    """The way of a mass of speed 1 that a force f pushes from a to b."""
    fast = np.sqrt(1.0 + 2.0 * f * (b - a))
    left = a + 2.0 * (b - a) / (1.0 + fast)
    inside = a + (t - a) + 0.5 * f * (t - a) ** 2
    return np.where(t < a, t, np.where(t < left, inside, b + fast * (t - left)))


WINDOWS = [
    "if(q.m > {a} and q.m < {b}, {f}, 0)",
    "if(abs(q.m - ({a} + {b})/2) < ({b} - {a})/2, {f}, 0)",
    "if(not (q.m < {a} or q.m > {b}), {f}, 0)",
    "{f}*if(min(q.m - {a}, {b} - q.m) > 0, 1, 0)",
]


@pytest.mark.parametrize(("way", "width", "law"), combined(WAYS, [1e-6, 4e-3, 0.3, 1.0], WINDOWS))
def test_a_window_of_the_way_is_never_passed_unseen(way, width, law):
    for a in (0.37, 3.0, 5.04):
        f = -0.3 / width if width < 1.0 else -0.3
        model = mass(law.format(a=a, b=a + width, f=f))
        run = pg.simulate(model, t_end=9.0, frames=91, **WAYS[way])
        known = through(run.t, a, a + width, f)
        rounded = 4 * np.finfo(float).eps * 9.0 * abs(f) * 9.0  # of the time at which it is met
        assert np.abs(run.q[:, 0] - known).max() < rounded + 1e-9


@pytest.mark.parametrize("way", WAYS)
def test_a_threshold_is_met_wherever_in_a_step_it_lies(way):
    for a in np.linspace(1.0, 1.5, 34):
        run = pg.simulate(mass(f"if(q.m > {a}, -0.2, 0)"), t_end=3.0, frames=4, **WAYS[way])
        assert abs(run.q[-1, 0] - (3.0 - 0.1 * (3.0 - a) ** 2)) < 1e-10


@pytest.mark.parametrize("way", ["default", "dop853", "radau5", "rk4", "gauss6"])
def test_a_change_on_a_bent_way_takes_few_steps(way):
    """Ten looks at most: secants gain half their digits again with each."""
    for a in np.linspace(0.3, 0.8, 6):
        laws = f"if(q.m > {a}, -0.2, 0)", "0*q.m"
        models = [mass(law, stiffness=(1.0,)) for law in laws]
        meets, free = (
            pg.simulate(x, t_end=1.4, frames=2, estimate=False, **WAYS[way]) for x in models
        )
        counts = [run.counters["evaluations"] for run in (meets, free)]
        each = counts[1] / free.counters["steps"]
        steps = meets.counters["steps"] - free.counters["steps"]
        assert counts[0] - counts[1] <= (10 + 3 + steps) * each  # 3 for what lies beyond


@pytest.mark.parametrize("way", WAYS)
def test_a_speed_and_a_moving_bound_are_met(way):
    run = pg.simulate(mass("if(v.m < 0.5, 0, -0.1)"), t_end=9.0, frames=2, **WAYS[way])
    assert abs(run.q[-1, 0] - (0.75 / 0.2 + 0.5 * 4.0)) < 1e-10
    law = "if(q.m > 0.5*t + 1, -0.1, 0)"  # from t = 2 to 12
    run = pg.simulate(mass(law), t_end=9.0, frames=2, **WAYS[way])
    assert abs(run.q[-1, 0] - (9.0 - 0.05 * 7.0**2)) < 1e-10


@pytest.mark.parametrize("way", WAYS)
def test_an_excursion_within_a_step_is_seen(way):
    """A mass on a spring that turns back just beyond a threshold; above it the spring is gone."""
    for short in (1e-2, 1e-4):
        law = f"if(q.m > {1 - short}, 1*q.m, 0)"
        run = pg.simulate(mass(law, stiffness=(1.0,)), t_end=3.0, frames=2, **WAYS[way])
        met = np.arcsin(1 - short)
        known = 1 - short + np.cos(met) * (3.0 - met)
        assert abs(run.q[-1, 0] - known) < max(20.0 * run.error_estimate, 1e-8)


@pytest.mark.parametrize("way", WAYS)
def test_a_comparison_that_is_far_away_changes_no_bit(way):
    laws = ["-1*q.m", "-1*q.m + if(q.m > 100 or 1*v.m < -99, 1, 0)"]
    one, two = (pg.simulate(mass(law), t_end=20.0, **WAYS[way]) for law in laws)
    assert np.array_equal(one.q, two.q)
    assert one.counters == two.counters


@pytest.mark.parametrize("width", [1e-3, 0.2])
def test_steps_from_outside_meet_what_a_run_meets(width):
    model = mass(f"if(q.m > 0.5 and q.m < {0.5 + width} or v.m < 0.8, -0.3, 0.1*cos(t))")
    run = pg.simulate(model, t_end=2.0, step=0.01, method="rk4", frames=201)
    stepper = pg.Stepper(model, step=0.01, method="rk4")
    batch = pg.BatchStepper(model, 3, step=0.01, method="rk4")
    for _ in range(200):
        stepper.step()
    batch.step(n=200)
    assert np.array_equal(stepper.q, run.q[-1])
    assert np.array_equal(batch.q, np.tile(run.q[-1], (3, 1)))


@pytest.mark.parametrize("way", WAYS)
def test_a_motion_slides_at_a_speed_that_both_sides_lead_to(way):
    """The sides push up to 0.5 m/s at 0.01 m/s² and down to it at 1 m/s²."""
    run = pg.simulate(mass("if(v.m > 0.5, -1, 0.01)"), t_end=3.0, frames=4, **WAYS[way])
    off = np.abs(run.q[1:, 0] - (0.375 + 0.5 * (run.t[1:] - 0.5))).max()
    assert off < max(5.0 * run.error_estimate, 1e-10)


@pytest.mark.parametrize("options", [{"step": 0.01}, {"rtol": 1e-4, "max_steps": 20000}])
def test_a_motion_that_both_sides_push_back_ends_with_a_status(options):
    """Dry friction that holds the mass: the sides follow each other at once."""
    run = pg.simulate(mass("if(v.m > 0, -0.3, 0.3)"), t_end=5.0, **options)
    known = 1.0 / 0.6
    if run.status.ok:
        assert abs(run.q[-1, 0] - known) < max(10 * run.error_estimate, 1e-6)
    else:
        assert "max_steps" in run.message


@pytest.mark.parametrize("options", [{}, {"step": 0.1, "method": "rk4"}])
def test_a_side_may_have_no_value_beyond_its_bound(options):
    """A square root that stops a mass, and has no value where it has turned back to."""
    law = "if(q.m < 1, -1*sqrt(1 - q.m), 0)"
    run = pg.simulate(mass(law, speed=2.0), t_end=3.0, **options)
    assert run.status.ok
    speed = np.sqrt(4.0 - 4.0 / 3.0)
    assert abs(run.v[-1, 0] - speed) < max(10.0 * run.error_estimate, 1e-6)


@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-6])
def test_a_finer_run_takes_other_steps_after_a_change(rtol):
    """A spring, beyond a threshold with a force too: the rest of the run is a step or two."""
    for a in np.linspace(0.3, 0.8, 9):
        model = mass(f"if(q.m > {a}, -0.2, 0)", stiffness=(1.0,))
        run = pg.simulate(model, t_end=1.9, frames=101, method="dop853", rtol=rtol)
        met = np.arcsin(a)
        after = -0.2 + (a + 0.2) * np.cos(run.t - met) + np.cos(met) * np.sin(run.t - met)
        error = np.abs(run.q[:, 0] - np.where(run.t < met, np.sin(run.t), after)).max()
        assert error < 10.0 * run.error_estimate + 1e-13


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("law", ["if(q.m > 0, -1, 1)", "if(q.m >= 0, -2, 2)"])
def test_a_mass_at_rest_between_two_pushes_stays(way, law):
    run = pg.simulate(mass(law, speed=0.0), t_end=1.0, frames=11, max_steps=2000, **WAYS[way])
    assert run.status.ok
    assert np.abs(run.q).max() < max(10.0 * run.error_estimate, 1e-10)


@pytest.mark.parametrize("law", ["if(q.m > 0, -1, 1)", "if(q.m > 0, 0, 1)", "min(q.m, 0)"])
def test_a_jump_at_the_start_is_no_stiffness(law):
    run = pg.simulate(mass(law), t_end=1.0, step=0.01, method="rk4")
    assert not run.notices


def bounces(t, stiffness, wall):
    """The way of sin(t) with a stiff spring beyond a wall, whose bounces repeat."""
    met, rate = np.arcsin(wall), np.sqrt(1.0 + stiffness)
    middle = stiffness * wall / (1.0 + stiffness)
    size = np.hypot(wall - middle, np.cos(met) / rate)
    ahead = np.arctan2(np.cos(met) / rate, wall - middle)
    inside = 2.0 * ahead / rate
    s = (t - met) % (inside + np.pi + 2.0 * met)
    there = middle + size * np.cos(rate * s - ahead)
    after = np.where(s < inside, there, np.sin(np.pi - met + s - inside))
    return np.where(t < met, np.sin(t), after)


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
@pytest.mark.parametrize(
    ("stiffness", "wall", "end", "steps"),
    [(117742, 0.8604, 4.2974, 2496), (1415.12, 0.5296, 7.0593, 2597), (2e4, 0.7, 6.0, 900)],
)
def test_a_stiff_side_of_a_comparison_is_in_the_estimate(method, stiffness, wall, end, steps):
    """A few steps lie within a bounce, and where they begin in it decides on their error."""
    model = mass(f"-{stiffness}*max(q.m - {wall}, 0)", stiffness=(1.0,))
    run = pg.simulate(model, t_end=end, step=end / steps, method=method, frames=101)
    error = np.abs(run.q[:, 0] - bounces(run.t, stiffness, wall)).max()
    assert error < 5.0 * run.error_estimate


def test_gauss6_solves_a_stiff_side_by_newtons_method():
    """The side has 16 rad per step. No step is divided for it."""
    model = mass("-1e5*max(q.m - 0.5, 0)", stiffness=(1.0,))
    run = pg.simulate(model, t_end=6.0, step=0.05, method="gauss6")
    assert run.status.ok
    error = np.abs(run.q[:, 0] - bounces(run.t, 1e5, 0.5)).max()
    assert error < max(10.0 * run.error_estimate, 1e-9)
    assert run.counters["rejected_steps"] == 0


def test_methods_keep_their_accuracy_at_torque_limits_and_stops():
    """The servo begins at its limit, and the slider runs into a stop and a slack cable."""
    arm = pg.Body(name="a", axes=(0, 1, 0), com=(0.3, 0, 0), inertia=(0.05, 0.06, 0.02), q=[0.2])
    block = pg.Body(name="b", joint="prismatic", axes=[(1, 0, 0)], mass=1.0, q=[0.5], v=[-2.0])
    servo = pg.Servo(name="s", body="a", kp=40.0, kd=2.0, target=1.2, torque_limit=3.0)
    ends = {"point": (0, 0, 0), "other_point": (0, 0.1, 0)}
    cable = pg.Lines(x=(0.2, 0.4, 1.0), value=(0, 0, 60))
    stop = {"bump_length": 0.3, "bump_stiffness": 500.0, "bump_damping": 0.5}
    strut = pg.Strut(name="t", body="b", spring=cable, **ends, **stop)
    model = pg.Model(bodies=[arm, block], forces=[servo, strut])
    call = {"t_end": 0.8, "frames": 9}
    exact = pg.simulate(model, method="dop853", rtol=1e-13, estimate=False, **call)
    for given in ({"method": "gauss6", "step": 0.005}, {"method": "dop853", "rtol": 1e-11}):
        run = pg.simulate(model, **given, **call)
        error = np.abs(run.q - exact.q).max()
        assert error < 2e-9
        assert error < 10.0 * run.error_estimate + 1e-13

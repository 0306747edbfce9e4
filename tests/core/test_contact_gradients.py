"""Derivatives through limits, friction of joints, events and switches.

They are compared with closed forms, and with differences between runs in the same phases: impacts
move within their steps alone.
"""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from .test_gradients import difference, missed, state

STEPS: dict[str, Any] = {"method": "moreau_jean", "step": 1e-3, "estimate": False, "frames": 31}


def apart(make, numbers, paths, share=1e-5, **options):
    """How far the derivatives of make(**numbers) are from differences, {path: relative error}.

    `paths` is {path: name of a number}.
    """
    given: dict[str, Any] = STEPS | {"t_end": 0.6} | options
    model = make(**numbers)
    plain = pg.simulate(model, **given)
    run = pg.simulate(model, wrt=list(paths), **given)
    assert plain == run
    assert plain.counters == run.counters
    found = {}
    for path, name in paths.items():
        h = share * max(abs(numbers[name]), 0.1)

        def moved(change, name=name):
            return state(pg.simulate(make(**numbers | {name: numbers[name] + change}), **given))

        found[path] = missed(run.sensitivity(path), difference(moved, h))
    return found


def pendulum(q, v, g, top, e):
    arm = pg.Body(
        name="arm", axes=(0, 1, 0), com=(1, 0, 0), inertia=(0.01,) * 3, q=[q], v=[v],
        limits=[(-1.0, top)], limit_restitution=(e,),
    )  # fmt: skip
    return pg.Model(bodies=[arm], gravity=(0, 0, g))


@pytest.mark.parametrize("restitution", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_a_limit(restitution, step):
    numbers = {"q": 0.3, "v": 0.2, "g": -9.81, "top": 1.2, "e": restitution}
    paths = {"q.arm": "q", "v.arm": "v", "gravity.2": "g", "bodies.arm.limits.0.1": "top"}
    found = apart(pendulum, numbers, paths, step=step)
    assert max(found.values()) < 1e-6, found


def rubbing(v, friction, mass, stiffness):
    body = pg.Body(
        name="s", joint="prismatic", axes=(1, 0, 0), mass=mass, v=[v], friction=(friction,)
    )
    spring = pg.Spring(name="k", body="s", other="ground", stiffness=stiffness, rest=0.0)
    return pg.Model(bodies=[body], forces=[spring], gravity=(0, 0, 0))


def test_friction_of_a_joint_that_slides_and_stops():
    numbers = {"v": 3.0, "friction": 8.0, "mass": 2.0, "stiffness": 30.0}
    paths = {"v.s": "v", "bodies.s.friction.0": "friction", "bodies.s.mass": "mass"}
    paths["forces.k.stiffness"] = "stiffness"
    found = apart(rubbing, numbers, paths, t_end=2.0)
    assert max(found.values()) < 1e-6, found


def slopes_of(closed, numbers, order=1e-3):
    """The derivatives of a closed form by each number, by differences of order 6."""
    return {
        name: difference(lambda x, n=name: closed(**numbers | {n: numbers[n] + x}), order)
        for name in numbers
    }


@pytest.mark.parametrize("step", [1e-3, 7e-3])
@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_a_mass_that_falls_onto_its_limit_follows_the_closed_form(step, restitution):
    """z = h - v² / 2g and so on: midpoint steps are exact under constant gravity."""
    numbers = {"z": 0.4, "v": -0.3, "g": -9.81, "floor": 0.1, "e": restitution}

    def closed(z, v, g, floor, e):
        late = (v + np.sqrt(v * v - 2 * g * (z - floor))) / -g
        speed, left = -e * (v + g * late), 0.4 - late
        return np.array([floor + speed * left + g * left**2 / 2, speed + g * left])

    body = pg.Body(
        name="m", joint="prismatic", axes=(0, 0, 1), mass=2.0, q=[0.4], v=[-0.3],
        limits=[(0.1, 2.0)], limit_restitution=(restitution,),
    )  # fmt: skip
    paths = {
        "q.m": "z", "v.m": "v", "gravity.2": "g", "bodies.m.limits.0.0": "floor",
        "bodies.m.limit_restitution.0": "e",
    }  # fmt: skip
    if restitution == 1.0:  # no restitution is above one
        del paths["bodies.m.limit_restitution.0"]
    run = pg.simulate(
        pg.Model(bodies=[body]), wrt=list(paths), **STEPS | {"t_end": 0.4, "step": step}
    )
    exact = slopes_of(closed, numbers)
    for path, name in paths.items():
        assert run.sensitivity(path)[-1] == pytest.approx(exact[name], rel=1e-6, abs=1e-6), path


def test_a_mass_that_friction_stops_follows_the_closed_form():
    """It slides v² m / 2F far, whatever the step."""
    numbers = {"v": 2.0, "friction": 8.0, "mass": 1.5}
    body = pg.Body(name="s", joint="prismatic", axes=(1, 0, 0), mass=1.5, v=[2.0], friction=(8.0,))
    paths = {"v.s": "v", "bodies.s.friction.0": "friction", "bodies.s.mass": "mass"}
    given: dict[str, Any] = STEPS | {"step": 1e-4}
    run = pg.simulate(pg.Model(bodies=[body], gravity=(0, 0, 0)), wrt=list(paths), **given)
    exact = slopes_of(lambda v, friction, mass: mass * v**2 / (2 * friction), numbers)
    for path, name in paths.items():
        assert run.sensitivity(path)[-1, 0] == pytest.approx(exact[name], rel=2e-4), path
        assert abs(run.sensitivity(path)[-1, 1]) < 1e-9


def ball(z, vx, vz, e, mu, g):
    body = pg.Body(
        name="b", joint="free", mass=1.0, inertia=np.eye(3) * 0.004, q=[0, 0, z, 1, 0, 0, 0],
        v=[0, 0, 0, vx, 0, vz], shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    touch = pg.Contact(name="c", body="b", restitution=e, friction=mu)
    return pg.Model(bodies=[body], contacts=[touch], gravity=(0, 0, g))


def test_sticking_at_the_limit_of_friction_is_named():
    """On the brink between rest and slip derivatives do not exist."""
    body = pg.Body(name="s", joint="prismatic", axes=(0, 0, 1), mass=2.0, friction=(2 * 9.81,))
    run = pg.simulate(pg.Model(bodies=[body]), wrt="bodies.s.mass", t_end=0.1, **STEPS)
    assert not np.isfinite(run.sensitivity("bodies.s.mass")[-1]).any()
    assert any("slip" in text for text in run.notices)


def test_a_contact_that_comes_near_ends_derivatives():
    model = ball(0.7, 1.0, 0.1, 0.7, 0.1, -9.81)
    given: dict[str, Any] = STEPS | {"t_end": 0.6, "method": "auto"}
    run = pg.simulate(model, wrt="q.b.2", **given)
    assert np.array_equal(run.q, pg.simulate(model, **given).q)
    found, before = run.sensitivity("q.b.2"), run.t < 0.3
    assert np.abs(found[before, 2] - 1.0).max() < 1e-9
    assert np.isnan(found[-1]).all()
    assert any("derivatives end" in text for text in run.notices)
    with pytest.raises(pg.InputError):
        pg.simulate(model, wrt="q.b.2", **STEPS)


def test_user_events_do_not_change_derivatives():
    model = swing_free()
    wrt = ["q.arm", "bodies.arm.mass"]
    for method in ("rk4", "dop853"):
        options: dict[str, Any] = {"t_end": 1.0, "frames": 21, "estimate": False, "step": 1e-2}
        options["method"] = method
        plain = pg.simulate(model, wrt=wrt, **options)
        run = pg.simulate(model, wrt=wrt, events=lambda t, q, v: q[0] - 0.1, **options)
        assert run.user_events
        for path in wrt:
            assert missed(run.sensitivity(path), plain.sensitivity(path)) < 1e-6


def swing_free():
    arm = pg.Body(name="arm", axes=(0, 1, 0), com=(0, 0, -1), mass=1.0, q=[0.7])
    end = pg.Body(
        name="end", parent="arm", axes=(0, 1, 0), link=(0, 0, -1), com=(0, 0, -0.5), mass=0.5
    )
    return pg.Model(bodies=[arm, end])


@pytest.mark.parametrize("method", ["rk4", "dop853", "radau5"])
def test_a_release_at_a_place_has_the_derivatives_of_its_time(method):
    """Driven at 1 m/s to 0.5 m, then free on a spring: starting farther on is being later."""
    fields: dict[str, Any] = {"axes": (1, 0, 0), "mass": 2.0, "inertia": (0.01,) * 3}
    body = pg.Body(name="b", joint="prismatic", q=[0.1], v=[1.0], **fields)
    drive = pg.Constraint(name="drive", kind="velocity", coefficients={"b": (1.0,)}, value=1.0)
    spring = pg.Spring(name="s", body="b", other="ground", stiffness=30.0, rest=0.0)
    model = pg.Model(bodies=[body], constraints=[drive], forces=[spring], gravity=(0, 0, 0))
    when = pg.Switch(constraint="drive", active=False, when={"coordinate": "b", "above": 0.5})
    options: dict[str, Any] = {
        "method": method, "t_end": 1.0, "frames": 21, "estimate": False, "switches": [when]
    }  # fmt: skip
    options |= {"rtol": 1e-11} if method != "rk4" else {"step": 1e-3}
    run = pg.simulate(model, wrt=["q.b", "bodies.b.mass"], **options)
    assert run == pg.simulate(model, **options)
    found, free = run.sensitivity("q.b"), run.t > 0.41
    assert np.abs(found[free, 0] - run.v[free, 0]).max() < 1e-6
    assert np.abs(found[free, 1] - run.vdot[free, 0]).max() < 1e-5
    rate, t = np.sqrt(30.0 / 2.0), run.t[free] - 0.4
    by_rate = -0.5 * t * np.sin(rate * t) + t * np.cos(rate * t) / rate - np.sin(rate * t) / rate**2
    exact = -by_rate * 0.5 * rate / 2.0
    assert np.abs(run.sensitivity("bodies.b.mass")[free, 0] - exact).max() < 1e-6


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6", "moreau_jean"])
def test_a_linearised_step_is_that_of_the_steps(method):
    model = pendulum(0.3, 0.2, -9.81, 2.0, 0.5) if method == "moreau_jean" else swing_free()
    model = model.edit(model.bodies[0].name, q=[0.4])
    stepper = pg.Stepper(model, method=method, step=1e-3)
    stepper.step(n=20)
    found, q, v = stepper.linearise(), stepper.q.copy(), stepper.v.copy()
    n = len(v)
    assert found.A.shape == (2 * n, 2 * n)
    assert found.B.shape == (2 * n, n)

    def after(dx, du):
        other = pg.Stepper(model, method=method, step=1e-3, q=q + dx[:n], v=v + dx[n:])
        other.step(tau=du)
        return np.concatenate((other.q, other.v))

    zero = np.zeros(n)
    for k, one in enumerate(np.eye(2 * n)):
        assert missed(found.A[:, k], difference(lambda x, a=one: after(x * a, zero), 1e-3)) < 1e-9
    for k, one in enumerate(np.eye(n)):
        exact = difference(lambda x, a=one: after(np.zeros(2 * n), x * a), 1e-1)
        assert missed(found.B[:, k], exact) < 1e-8

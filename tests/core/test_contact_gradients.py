"""Derivatives through limits, friction of joints, events and switches.

They are compared with closed forms, and with differences between runs in the same phases: impacts
move within their steps alone.
"""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
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


@pytest.mark.parametrize(("restitution", "step"), combined([0.0, 0.6, 1.0], [1e-3, 1e-2]))
def test_a_limit(restitution, step):
    numbers = {"q": 0.3, "v": 0.2, "g": -9.81, "top": 1.2, "e": restitution}
    paths = {"q.arm": "q", "v.arm": "v", "gravity.2": "g", "bodies.arm.limits.0.1": "top"}
    found = apart(pendulum, numbers, paths, step=step)
    assert max(found.values()) < 1e-6, found


def test_dry_friction_may_act_from_the_start():
    """Bodies that are released at rest slide backwards at once: friction has no gap to change."""
    given: dict[str, Any] = STEPS | {"t_end": 0.6}
    model, path = pg.Model.serial(2).edit("2", friction=0.02), "bodies.2.friction.0"
    run = pg.simulate(model, wrt=[path], **given)
    ends = [pg.simulate(model.edit("2", friction=0.02 + h), **given) for h in (1e-5, -1e-5)]
    assert not any("derivatives" in text for text in run.notices)
    assert missed(run.sensitivity(path), (state(ends[0]) - state(ends[1])) / 2e-5) < 1e-5


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


BALL = {"z": 0.7, "vx": 1.0, "vz": 0.1, "e": 0.7, "mu": 0.1, "g": -9.81}
PATHS = {"q.b.2": "z", "v.b.3": "vx", "contacts.c.restitution": "e", "gravity.2": "g"}


@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_a_ball_that_bounces(step):
    found = apart(ball, BALL, PATHS, step=step)
    assert max(found.values()) < 1e-7, found


def test_a_ball_that_slides_until_it_rolls():
    numbers = BALL | {"z": 0.1, "vz": 0.0, "mu": 0.5}
    found = apart(ball, numbers, {"v.b.3": "vx", "contacts.c.friction": "mu"}, t_end=0.3)
    assert max(found.values()) < 1e-7, found
    run = pg.simulate(ball(**numbers), wrt=["contacts.c.friction"], **STEPS | {"t_end": 0.3})
    assert np.abs(run.sensitivity("contacts.c.friction")[-1, 7:]).max() < 1e-9  # it rolls


def test_a_ball_that_bounces_follows_the_closed_form_after_the_impact():
    numbers = {"z": 0.7, "e": 0.7, "g": 9.81}
    run = pg.simulate(ball(**BALL | {"vz": 0.0}), wrt=list(PATHS), **STEPS | {"t_end": 0.6})

    def closed(z, e, g):
        fall = np.sqrt(2.0 * (z - 0.1) / g)
        rise = 0.6 - fall
        return 0.1 + e * g * fall * rise - 0.5 * g * rise**2

    exact = slopes_of(closed, numbers)
    assert run.sensitivity("q.b.2")[-1, 2] == pytest.approx(exact["z"], rel=1e-6)
    assert run.sensitivity("contacts.c.restitution")[-1, 2] == pytest.approx(exact["e"], rel=1e-6)
    assert run.sensitivity("gravity.2")[-1, 2] == pytest.approx(-exact["g"], rel=1e-6)


def two_balls(offset, speed, mass, e):
    shape = pg.Shape(kind="sphere", radius=0.1)
    fields: dict[str, Any] = {"joint": "free", "shape": shape}
    first = pg.Body(name="a", link=(0, 0, 1), mass=mass, v=(0, 0, 0, speed, 0, 0), **fields)
    other = pg.Body(name="b", link=(0.4, offset, 1), mass=2.0, **fields)
    touch = pg.Contact(name="c", body="a", other="b", restitution=e)
    return pg.Model(bodies=[first, other], contacts=[touch], gravity=(0, 0, 0))


def test_two_balls_that_meet_off_their_centres():
    numbers = {"offset": 0.05, "speed": 2.0, "mass": 1.0, "e": 0.5}
    paths = {"bodies.b.link.1": "offset", "v.a.3": "speed", "bodies.a.mass": "mass"}
    found = apart(two_balls, numbers, paths | {"contacts.c.restitution": "e"}, t_end=0.4)
    assert max(found.values()) < 1e-7, found


def tumbling(kind, mu, spin, size):
    sizes = {"box": {"size": (0.2, 0.15, 2 * size)}, "cylinder": {"radius": size, "length": 0.3}}
    body = pg.Body(
        name="b", joint="free", link=(0, 0, 0.3), v=(0.5, spin, 0.2, 0.1, 0, 0),
        shape=pg.Shape(kind=kind, **sizes[kind]),
    )  # fmt: skip
    touch = pg.Contact(name="c", body="b", friction=mu, restitution=0.2)
    return pg.Model(bodies=[body], contacts=[touch])


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_a_body_that_lands_on_a_corner_or_a_rim(kind):
    numbers = {"mu": 0.3, "spin": 1.0, "size": 0.2 if kind == "box" else 0.1}
    size = "bodies.b.shape.size.2" if kind == "box" else "bodies.b.shape.radius"
    moved = apart(lambda **x: tumbling(kind, **x), numbers, {"v.b.1": "spin"}, t_end=0.2)
    assert max(moved.values()) < 1e-5, moved
    model = tumbling(kind, **numbers)
    run = pg.simulate(model, wrt=[size], **STEPS | {"t_end": 0.2})
    assert np.isfinite(run.sensitivity(size)).all()


def test_an_impact_beside_a_loaded_contact():
    numbers = {"mu": 0.3, "spin": 1.0, "size": 0.2}
    moved = apart(lambda **x: tumbling("box", **x), numbers, {"v.b.1": "spin"}, t_end=0.24)
    assert max(moved.values()) < 1e-4, moved


def sliding(mu, v, mass):
    body = pg.Body(
        name="b", joint="free", mass=mass, link=(0, 0, 0.05), v=(0, 0, 0, v, 0.1, 0),
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.1)),
    )  # fmt: skip
    return pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b", friction=mu)])


def test_a_box_that_slides_to_rest():
    numbers = {"mu": 0.5, "v": 1.0, "mass": 2.0}
    found = apart(sliding, numbers, {"contacts.c.friction": "mu", "v.b.3": "v"}, t_end=0.3)
    assert max(found.values()) < 1e-7, found
    run = pg.simulate(sliding(**numbers), wrt=["bodies.b.mass"], **STEPS | {"t_end": 0.3})
    assert np.abs(run.sensitivity("bodies.b.mass")).max() < 1e-9


@pytest.mark.parametrize(
    ("size", "spin", "speed", "friction"),
    [
        ((0.29, 0.18, 0.29), (-3.9, 0.4), (-0.8, 0.2), 0.5),
        ((0.17, 0.3, 0.14), (-4.0, -0.1), (0.3, 0.3), 0.9),
        ((0.21, 0.2, 0.27), (0.3, -0.2), (0.0, -0.3), 0.3),
    ],
)
def test_the_mass_of_a_box_does_not_influence_its_landing(size, spin, speed, friction):
    body = pg.Body(
        name="b", joint="free", mass=2.0, link=(0, 0, 0.2), v=(0, *spin, *speed, 0),
        shape=pg.Shape(kind="box", size=size),
    )  # fmt: skip
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b", friction=friction)])
    options = STEPS | {"step": 2e-3, "t_end": 0.3}
    by_mass = pg.simulate(model, wrt=["bodies.b.mass"], **options).sensitivity("bodies.b.mass")
    assert np.nanmax(np.abs(by_mass)) < 1e-9  # nan where they have ended
    assert np.isfinite(by_mass[:10]).all()


def test_corners_that_slide_in_different_directions_end_derivatives():
    body = pg.Body(
        name="b", joint="free", mass=2.0, link=(0, 0, 0.05), v=(0, 0, 1, 1, 0, 0),
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.1)),
    )  # fmt: skip
    model = pg.Model(bodies=[body], contacts=[pg.Contact(name="c", body="b", friction=0.3)])
    run = pg.simulate(model, wrt=["bodies.b.mass"], **STEPS | {"t_end": 0.03})
    assert np.isnan(run.sensitivity("bodies.b.mass")[1:]).all()
    assert any("different directions" in text for text in run.notices)


CHOSEN = ("dopri5", "dop853", "radau5")


@pytest.mark.parametrize("method", ["rk4", "gauss6", "moreau_jean", *CHOSEN])
def test_a_soft_contact(method):
    def landing(z, stiffness):
        touch = pg.Contact(name="c", body="b", law="soft", stiffness=stiffness, friction=0.3)
        return ball(**BALL | {"z": z}).remove("c").add(touch)

    numbers = {"z": 0.12, "stiffness": 1e5}
    paths = {"q.b.2": "z", "contacts.c.stiffness": "stiffness"}
    steps: dict[str, Any] = {"method": method, "t_end": 0.12}
    steps |= {"step": None, "rtol": 1e-10} if method in CHOSEN else {"step": 1e-4}
    found = apart(landing, numbers, paths, **steps)
    assert max(found.values()) < 1e-5, found


@pytest.mark.parametrize("depth", [1e-1, 1e-2, 1e-3, 1e-4])  # of the impact, relative to the radius
def test_a_hard_soft_contact_has_right_derivatives_or_a_warning(depth):
    """In the limit of a hard contact, t and v do not change in an elastic impact.

    The ball falls without sliding, where the slip speed has no derivative but friction has.
    """
    g, height, radius = 9.81, 0.5, 0.1
    ball = pg.Body(
        name="ball", joint="prismatic", axes=(0, 0, 1), mass=1.0, inertia=(0.004, 0.004, 0.004),
        shape=pg.Shape("sphere", radius=radius), q=radius + height,
    )  # fmt: skip
    stiffness = 1.25 * 2.0 * g * height / (radius * depth) ** 2.5
    contact = pg.Contact(
        name="c", body="ball", law="soft", stiffness=stiffness, damping=0.0, friction=0.3
    )
    model = pg.Model(bodies=(ball,), contacts=(contact,))
    landed = np.sqrt(2.0 * height / g)
    run = pg.simulate(model, t_eval=(0.0, 0.5 * landed, 1.3 * landed), wrt=["v.ball"])
    found = run.sensitivity("v.ball")[:, 0]
    assert found[1] == pytest.approx(0.5 * landed)
    told = any("derivatives by v.ball are" in text for text in run.notices)
    assert told or found[2] == pytest.approx(-0.7 * landed, rel=0.06)
    assert told or depth > 1e-3
    lossy = pg.Model(bodies=(ball,), contacts=(contact.model_copy(update={"damping": None}),))
    run = pg.simulate(lossy, t_end=1.3 * landed, wrt=["v.ball"])  # touches at a depth of 0
    assert np.isfinite(run.sensitivity("v.ball")).all()


def test_laws_without_derivatives_are_refused():
    model = ball(**BALL).remove("c")
    for law in ({"law": "penalty", "stiffness": 1e4}, {"rolling_friction": 0.01}):
        with pytest.raises(pg.InputError):
            pg.simulate(model.add(pg.Contact(name="c", body="b", **law)), wrt="q.b.2", **STEPS)


def test_a_friction_coefficient_is_fitted_with_exact_derivatives():
    truth = pg.simulate(sliding(0.37, 1.0, 2.0), t_end=0.3, **{**STEPS, "frames": 61})
    data = {"t": truth.t, "b.0": truth["b.0"]}
    free = {"contacts.c.friction": (0.1, 1.0)}
    fit = pg.fit(sliding(0.6, 1.0, 2.0), data, free, method="moreau_jean", step=1e-3)
    assert fit.values["contacts.c.friction"] == pytest.approx(0.37, abs=1e-6)


def test_a_switched_constraint_does_not_end_derivatives_of_the_motion():
    """Those of the energy that its impulse takes are not known."""
    slider = pg.Body(name="c", joint="prismatic", axes=(1, 0, 0), mass=1.0, v=(1.0,))
    lock = pg.Velocity(name="lock", coefficients={"c": (1.0,)}, active=False)
    model = pg.Model(gravity=(0, 0, 0), bodies=(slider,), constraints=(lock,))
    switches = [({"coordinate": "c", "above": 0.53}, "lock", True)]
    run = pg.simulate(model, t_end=1.0, frames=5, wrt=["q.c", "v.c"], switches=switches)
    assert run.sensitivity("q.c")[-1, 0] == pytest.approx(0.0, abs=1e-9)  # it stops at 0.53
    assert not any("derivatives" in text for text in run.notices)


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


# -- the start of contact --------------------------------------------------------------------------


def dropped(height, **law):
    body = pg.Body(
        name="ball", joint="prismatic", axes=(0, 0, 1), mass=1.0, q=(height,),
        shape=pg.Shape("sphere", radius=0.1), inertia=(0.004,) * 3,
    )  # fmt: skip
    return pg.Model(bodies=(body,), contacts=(pg.Contact(name="c", body="ball", **law),))


@pytest.mark.parametrize(
    ("height", "law", "options"),
    combined(
        [0.15, 0.3, 5.0],
        [{"restitution": 0.6}, {"law": "soft"}],
        [{}, {"step": 1e-2}, {"step": 1e-3}],
    ),
)
def test_derivatives_continue_where_bodies_come_close(height, law, options):
    """Before the impact, z depends on gravity by t²/2 and on the initial speed by t."""
    t = np.linspace(0.0, 0.99 * np.sqrt(2 * (height - 0.1) / 9.81), 23)
    run = pg.simulate(dropped(height, **law), t_eval=t, wrt=("gravity.2", "v.ball"), **options)
    np.testing.assert_allclose(run.sensitivity("gravity.2")[:, 0], t**2 / 2, atol=1e-9 * height)
    np.testing.assert_allclose(run.sensitivity("v.ball")[:, 0], t, atol=1e-9)
    assert run.status.ok
    assert not any("derivatives" in text for text in run.notices)


def resting(kind, **fields):
    shape = (
        pg.Shape("sphere", radius=0.1) if kind == "ball" else pg.Shape("box", size=(0.4, 0.3, 0.2))
    )
    box = pg.Body(
        name="body", joint="free", q=(0, 0, 0.1, 1, 0, 0, 0), mass=2.0, inertia=(0.02, 0.03, 0.04),
        shape=shape, **fields,
    )  # fmt: skip
    return pg.Model(bodies=(box,), contacts=(pg.Contact(name="c", body="body", friction=0.3),))


LIMITED = pg.Model(
    bodies=(
        pg.Body(name="body", joint="prismatic", axes=(0, 0, 1), mass=1.0, limits=((0.0, 1.0),)),
    )
)


@pytest.mark.parametrize(
    ("model", "path"),
    [
        (resting("box"), "bodies.body.shape.size.2"), (resting("ball"), "bodies.body.shape.radius"),
        (resting("box", v=(0, 0, 0, 2, 0, 0)), "bodies.body.shape.size.2"),
        (LIMITED, "bodies.body.limits.0.0"), (LIMITED, "q.body"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_parameters_of_a_gap_that_is_closed_from_the_start_have_no_derivatives(model, path, step):
    run = pg.simulate(model, t_end=0.2, step=step, method="moreau_jean", wrt=(path,))
    assert not np.isfinite(run.sensitivity(path)[1:]).any()
    assert any("derivatives end" in text and "gap" in text for text in run.notices)


@pytest.mark.parametrize(
    ("model", "path"),
    [
        (resting("box", v=(0, 0, 0, 2, 0, 0)), "bodies.body.shape.size.0"),
        (resting("box", v=(0, 0, 0, 2, 0, 0)), "contacts.c.friction"),
        (LIMITED, "bodies.body.mass"),
    ],
)  # fmt: skip
def test_other_parameters_of_bodies_at_rest_keep_their_derivatives(model, path):
    run = pg.simulate(model, t_end=0.2, step=1e-3, method="moreau_jean", wrt=(path,))
    assert np.isfinite(run.sensitivity(path)).all()
    assert not any("derivatives end" in text for text in run.notices)


def test_a_limit_that_is_hit_after_the_ground_in_the_same_step():
    """The limit is located while the end of the part before is still that at the ground."""
    box = pg.Body(
        name="box", joint="compound", mass=1.0, inertia=(0.01, 0.01, 0.01),
        motions=[("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))],
        shape=pg.Shape("box", size=(0.3, 0.2, 0.2)),
    )  # fmt: skip
    rod = pg.Body(
        name="rod", parent="box", axes=(0, 1, 0), mass=0.3, com=(0, 0, -0.2),
        inertia=(0.004, 0.0044, 0.002), limits=((-0.5, 0.5),),
    )  # fmt: skip
    spring = pg.Spring(
        name="spring", body="rod", point=(0, 0, -0.4), other_point=(0, 0, 1), stiffness=2.0,
        rest=0.5,
    )  # fmt: skip
    contact = pg.Contact(name="c", body="box", friction=0.8, restitution=0.4)
    model = pg.Model(bodies=(box, rod), contacts=(contact,), forces=(spring,))

    def end(x):
        stepper = pg.Stepper(model, step=0.0047, q=x[:4], v=x[4:])
        stepper.step()
        return np.concatenate((stepper.q, stepper.v))

    x, h = np.array([0.5996, 0.15199, 1.58126, -0.4995, 1.44394, -0.64156, 3.64605, 0.16814]), 1e-6
    A = pg.Stepper(model, step=0.0047, q=x[:4], v=x[4:]).linearise().A
    wanted = np.array([end(x + h * e) - end(x - h * e) for e in np.eye(8)]).T / (2 * h)
    np.testing.assert_allclose(A, wanted, atol=1e-6 * np.abs(wanted).max())

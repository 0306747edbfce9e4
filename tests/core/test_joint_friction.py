"""Dry friction of joints: it holds below its limit, slides by Coulomb's law, and takes energy."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined

G = 9.81
MOREAU: dict[str, Any] = {"method": "moreau_jean"}


def slider(share, size=1.0):
    """A mass on a vertical slider; its weight is `share` of the friction."""
    mass = 2.0 * size
    return pg.Body(
        name="s", joint="prismatic", axes=(0, 0, 1), mass=mass, friction=(mass * G / share,)
    )


def arm(share, count=3):
    """Hinges one after the other, straight out; each bears `share` of what its friction holds."""
    bodies = []
    for n in range(count):
        left = count - n
        moment = G * sum(0.2 + 0.4 * k for k in range(left))
        bodies.append(
            pg.Body(
                name=f"b{n}", parent=f"b{n - 1}" if n else "ground", axes=(0, 1, 0), mass=1.0,
                link=(0.4, 0, 0) if n else (0, 0, 0), com=(0.2, 0, 0), inertia=np.eye(3) * 0.01,
                friction=(moment / share,),
            )
        )  # fmt: skip
    return bodies


def loop(share):
    """Two rods that carry a bar between their ends; friction of three hinges bears their moment."""
    moment = (2 * 0.5 * 0.25 + 0.4 * 0.5) * G * np.sin(0.4)
    rods = [
        pg.Body(
            name=name, axes=(0, 1, 0), mass=0.5, com=(0, 0, 0.25), inertia=np.eye(3) * 0.01,
            q=(0.4,), friction=(0.4 * moment / share,), link=(place, 0, 0),
        )
        for name, place in (("left", 0.0), ("right", 1.0))
    ]  # fmt: skip
    bar = pg.Body(
        name="bar", parent="left", axes=(0, 1, 0), link=(0, 0, 0.5), mass=0.4, com=(0.5, 0, 0),
        inertia=np.eye(3) * 0.01, q=(-0.4,), friction=(0.2 * moment / share,),
    )  # fmt: skip
    pin = pg.Point(
        name="pin", body="bar", other="right", point=(1.0, 0, 0), other_point=(0, 0, 0.5)
    )
    return pg.Model(bodies=[*rods, bar], constraints=[pin])


def with_a_box(model):
    """The same model beside a box that lies on the ground."""
    box = pg.Body(
        name="box", joint="free", q=(5, 0, 0.1, 1, 0, 0, 0), mass=1.0,
        shape={"kind": "box", "size": (0.2, 0.2, 0.2)}, derived=("inertia",),
    )  # fmt: skip
    return model.add(box).add(pg.Contact(name="floor", body="box"))


HELD = {
    "slider": pg.Model(bodies=[slider(0.9)]),
    "small slider": pg.Model(bodies=[slider(0.99, 1e-6)]),
    "large slider": pg.Model(bodies=[slider(0.5, 1e6)]),
    "hinge": pg.Model(bodies=arm(0.9, 1)),
    "arm": pg.Model(bodies=arm(0.9)),
    "long arm": pg.Model(bodies=arm(0.98, 8)),
    "arm beside a box": with_a_box(pg.Model(bodies=arm(0.9))),
    "tendon": pg.Model(
        bodies=arm(np.inf, 1),
        forces=[pg.Tendon(name="t", coefficients={"b0": (0.5,)}, friction=4.2)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HELD)
def test_a_joint_below_its_friction_holds(name):
    """For 20 s at the default step, to 1e-11 m or rad a second; friction bears its load."""
    run = pg.simulate(HELD[name], t_end=20.0, frames=11, estimate=False, **MOREAU)
    assert run.status is pg.Status.DONE
    assert np.abs(run.q - run.q[0]).max() < 2e-10
    assert np.abs(run.vdot).max() < 1e-9


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_loop_with_friction_in_its_hinges_holds(share):
    mech = pg.Mechanism(loop(share))
    run = pg.simulate(mech, t_end=20.0, frames=11, estimate=False, **MOREAU)
    assert np.abs(run.q - run.q[0]).max() < 2e-10


@pytest.mark.parametrize(
    ("joint", "size", "step"), combined(["prismatic", "revolute"], [1e-6, 1.0, 1e6], [1e-3, 3e-3])
)
def test_a_joint_slides_to_a_stop_and_stays(joint, size, step):
    """Against v0 t - a t²/2: exact while it slides, and within a step's way of the stop."""
    a, v0 = 1.7, 1.0
    body = pg.Body(
        name="b", joint=joint, axes=(0, 0, 1), mass=size, inertia=np.eye(3) * size,
        friction=(a * size,), v=(v0,),
    )  # fmt: skip
    model = pg.Model(bodies=[body], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=1.0, step=step, **MOREAU)
    sliding = np.minimum(run.t, v0 / a)
    exact = v0 * sliding - 0.5 * a * sliding**2
    before = run.t < v0 / a - step
    assert np.abs(run.q[before, 0] - exact[before]).max() < 1e-12
    assert np.abs(run.q[:, 0] - exact).max() < 0.125 * a * step**2 + 1e-12
    assert np.abs(run.v[run.t > v0 / a + step]).max() < 1e-15
    assert np.diff(run.energy).max() <= 1e-14 * size
    assert run.dissipation[-1] == pytest.approx(0.5 * size, rel=1e-12)


@pytest.mark.parametrize("beside", [False, True])
def test_energy_of_a_falling_arm_with_friction_never_grows(beside):
    """Its joints slide, turn around and stick until it hangs at rest."""
    model = pg.Model(bodies=arm(8.0))
    model = with_a_box(model) if beside else model
    run = pg.simulate(model, t_end=20.0, estimate=False, **MOREAU)
    size = run.energy[0] - run.energy[-1]
    assert np.diff(run.energy).max() < 1e-3 * size
    assert np.abs(run.v[-1]).max() < 1e-12
    late = run.t > 15.0
    assert np.ptp(run.energy[late]) < 1e-9 * size


def test_a_joint_that_slides_all_the_time_keeps_the_accuracy_of_its_method():
    """A pendulum that is driven around: half the step has a quarter of the error."""
    hinge = pg.Body(
        name="b", axes=(0, 1, 0), mass=1.0, com=(0, 0, -0.3), inertia=np.eye(3) * 0.1,
        friction=(0.4,), v=(9.0,),
    )  # fmt: skip
    model = pg.Model(bodies=[hinge], forces=[pg.Motor(name="m", body="b", torque=0.4)])
    exact = pg.simulate(
        model.edit("b", friction=(0.0,)).edit("m", torque=0.0), t_end=1.0, rtol=1e-11
    )
    errors = []
    for step in (2e-3, 1e-3):
        run = pg.simulate(model, t_end=1.0, step=step, frames=501, **MOREAU)
        errors.append(abs(run.q[-1, 0] - exact.q[-1, 0]))
    assert errors[1] < 0.3 * errors[0] < 1e-4


def test_friction_does_nothing_in_an_impact():
    """A slider with friction hits its limit: what rebounds is the restitution's part."""
    body = pg.Body(
        name="s", joint="prismatic", axes=(1, 0, 0), mass=1.0, friction=(2.0,), v=(1.0,),
        limits=((None, 0.1),), limit_restitution=(0.5,),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=[body], gravity=(0, 0, 0)), t_end=1.0, **MOREAU)
    before = np.sqrt(1.0 - 4.0 * 0.1)
    assert run.v.min() == pytest.approx(-0.5 * before, rel=0.01)
    back = (0.5 * before) ** 2 / 4.0
    assert run.q[-1, 0] == pytest.approx(0.1 - back, abs=1e-6)


@pytest.mark.parametrize("name", ["slider", "arm", "tendon"])
def test_joints_hold_by_default(name):
    run = pg.simulate(HELD[name], t_end=10.0, frames=11, estimate=False)
    stepper = pg.Stepper(HELD[name])
    for _ in range(100):
        stepper.step()
    assert np.abs(run.q - run.q[0]).max() < 1e-9
    assert np.abs(stepper.q - run.q[0]).max() < 1e-9


def test_a_swing_ends_where_coulombs_law_holds_it():
    """From a it swings across to b with m g l (cos b - cos a) = f (a + b), until f holds it."""
    friction, moment, at, side = 0.5, G * 0.3, 1.5, 1.0
    while moment * np.sin(at) > friction:
        low, b, high = -np.arcsin(friction / moment), 0.0, at
        for _ in range(60):
            b = 0.5 * (low + high)
            left = moment * (np.cos(b) - np.cos(at)) - friction * (at + b)
            low, high = (b, high) if left > 0.0 else (low, b)
        at, side = b, -side
    hinge = pg.Body(
        name="b", axes=(0, 1, 0), mass=1.0, com=(0, 0, -0.3), inertia=np.eye(3) * 0.1,
        friction=(friction,), q=(1.5,),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=[hinge]), t_end=20.0, frames=11, estimate=False)
    assert run["b"][-1] == pytest.approx(side * at, abs=1e-5)


OTHERS: list[dict[str, Any]] = [
    {"method": "dopri5", "rtol": 1e-6}, {"method": "radau5"}, {"method": "rk4", "step": 1e-4},
    {"rtol": 1e-8},
]  # fmt: skip


def crept(run):
    """Return the distance in the notice about a joint that creeps, or 0 without one."""
    found = [text for text in run.notices if "creeps" in text]
    assert all("moreau_jean" in text for text in found)
    return float(found[0].partition(" by ")[2].split()[0]) if found else 0.0


@pytest.mark.parametrize(("given", "share"), combined(OTHERS, [0.5, 0.9, 0.999, 0.9999]), ids=str)
def test_methods_without_impulses_state_how_far_a_joint_creeps(given, share):
    """It is the whole way of a joint whose friction should hold it, at any speed."""
    run = pg.simulate(pg.Model(bodies=[slider(share)]), t_end=1.0, estimate=False, **given)
    assert run["s"][-1] < -5e-4
    assert crept(run) == pytest.approx(-run["s"][-1], rel=0.01)


@pytest.mark.parametrize("kd", [40.0, 400.0])
def test_a_joint_that_a_servo_moves_slowly_does_not_creep(kd):
    """Its friction is overcome, although regularised friction is less than the limit."""
    body = pg.Body(name="s", joint="prismatic", mass=1.0, friction=(10.0,), v=(0.03,))
    way = pg.Table(t=(0.0, 10.0), value=(0.0, 0.3))
    servo = pg.Servo(name="m", body="s", kp=4000.0, kd=kd, target=way)
    model = pg.Model(bodies=[body], forces=[servo], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=10.0, method="dop853", estimate=False)
    assert run["s"][-1] > 0.29
    assert crept(run) < 0.01 * run["s"][-1]


def test_a_joint_above_its_friction_slides():
    run = pg.simulate(pg.Model(bodies=[slider(1.001)]), t_end=1.0, method="dop853")
    assert crept(run) == 0.0


@pytest.mark.parametrize(
    ("frictions", "told"), [((20, 20, 20), True), ((20, 20, 0), True), ((0, 0, 20), False)]
)
def test_a_loop_whose_joints_stick_is_told(frictions, told):
    """Two rows and three frictions on three joints: forces at rest are not unique."""
    links = [("a", 0.4, -1.2, 0.0), ("b", 0.9, 0.9, 0.4), ("c", 0.7, -1.6, 1.0)]
    bodies = [
        pg.Body(
            name=name, parent="a" if name == "b" else "ground", link=(at, 0, 0),
            axes=((0, 1, 0),), mass=1.0, com=(length / 2, 0, 0), inertia=(0.01, 0.06, 0.06),
            tip=(length, 0, 0), q=(q,), friction=friction,
        )
        for (name, length, q, at), friction in zip(links, frictions)
    ]  # fmt: skip
    pin = pg.Line(
        name="pin", body="b", other="c", point=(0.9, 0, 0), other_point=(0.7, 0, 0),
        other_axis=(0, 1, 0),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=bodies, constraints=[pin]), t_end=0.05, estimate=False)
    found = [text for text in run.notices if "stick by dry friction" in text]
    assert len(found) == told
    assert all("'pin'" in text for text in found)

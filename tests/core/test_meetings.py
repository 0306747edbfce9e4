"""Time stepping locates impacts: nothing passes, chains of impacts, depth, regular slides."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import pgraph_core as pg
from benchmarks import passing

G = 9.81


def shot(speed, radius, wall, **law):
    """A ball that flies along x at a wall whose face is 30 cm from it."""
    ball = pg.Body(
        name="ball", joint="free", shape={"kind": "sphere", "radius": radius},
        inertia=0.4 * radius**2 * np.eye(3),
    )  # fmt: skip
    plate = pg.Body(
        name="plate", joint="weld", link=(0.3 + radius + 0.5 * wall, 0, 0),
        shape={"kind": "box", "size": (wall, 2.0, 2.0)},
    )  # fmt: skip
    contact = pg.Contact(name="hit", body="ball", other="plate", **law)
    mech = pg.Mechanism(pg.Model(bodies=(ball, plate), gravity=(0, 0, 0), contacts=(contact,)))
    q, v = mech.home()
    v[3] = speed
    return mech, q, v


@pytest.mark.parametrize("speed", [1.0, 50.0, 1000.0])
@pytest.mark.parametrize(("radius", "wall"), [(1e-3, 1e-3), (0.01, 0.005), (0.1, 1e-3)])
def test_nothing_passes_a_wall(speed, radius, wall):
    """The ball turns where it touches, at restitution times its speed, however thin both are."""
    mech, q, v = shot(speed, radius, wall, restitution=0.5)
    t_end = 0.45 / speed  # twice the flight, and more
    run = pg.simulate(mech, q, v, t_end=t_end, step=1e-3, method="moreau_jean", estimate=False)
    assert run.v[-1, 3] == pytest.approx(-0.5 * speed, rel=1e-12)
    assert run.q[-1, 0] == pytest.approx(0.3 - 0.5 * 0.15, abs=1e-9)


def rebounds(masses, x, u, width, e, t_end):
    """Places and velocities of balls on a line after impacts one by one: momentum and Newton's."""
    t, x, u = 0.0, x.copy(), u.copy()
    while True:
        closing = u[:-1] - u[1:]
        gap = np.maximum(np.diff(x) - width, 0.0)
        times = np.where(closing > 1e-12, gap / np.where(closing > 1e-12, closing, 1.0), np.inf)
        k = int(np.argmin(times))
        if t + times[k] > t_end:
            return x + u * (t_end - t), u
        x, t = x + u * times[k], t + times[k]
        a, b = masses[k], masses[k + 1]
        p = (1 + e) * closing[k] * a * b / (a + b)
        u[k] -= p / a
        u[k + 1] += p / b


@pytest.mark.parametrize(("count", "e"), [(3, 0.9), (5, 1.0), (4, 0.5), (3, 0.0)])
def test_a_chain_of_balls_hits_in_turn(count, e):
    """Impacts within one step are taken one after the other, each when it happens."""
    masses = 1.0 + np.arange(count)
    bodies = tuple(
        pg.Body(name=f"b{k}", joint="prismatic", axes=((1, 0, 0),), link=(0.201 * k, 0, 0),
                mass=masses[k], shape={"kind": "sphere", "radius": 0.1})
        for k in range(count)
    )  # fmt: skip
    contacts = tuple(
        pg.Contact(name=f"c{k}", body=f"b{k}", other=f"b{k + 1}", restitution=e)
        for k in range(count - 1)
    )
    mech = pg.Mechanism(pg.Model(bodies=bodies, gravity=(0, 0, 0), contacts=contacts))
    speeds = np.eye(count)[0]
    run = pg.simulate(mech, np.zeros(count), speeds, t_end=0.2, step=1e-2, method="moreau_jean")
    x, u = rebounds(masses, 0.201 * np.arange(count), speeds, 0.2, e, 0.2)
    np.testing.assert_allclose(run.q[-1], x - 0.201 * np.arange(count), atol=1e-9)
    np.testing.assert_allclose(run.v[-1], u, atol=1e-9)


def test_an_elastic_hinge_goes_to_and_fro_between_its_limits():
    """Without gravity: a zigzag, for ever."""
    arm = pg.Body(
        name="arm", axes=((0, 1, 0),), com=(0, 0, -0.5), inertia=0.1 * np.eye(3),
        limits=(-3, 3), limit_restitution=1.0,
    )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=(arm,), gravity=(0, 0, 0)))
    run = pg.simulate(mech, [0.0], [2.0], t_end=20.0, step=1e-2, method="moreau_jean")
    place = np.abs((2.0 * run.t - 3.0) % 12.0 - 6.0) - 3.0
    np.testing.assert_allclose(run.q[:, 0], place, atol=1e-7)  # seven hits, each 1e-9 early


def test_a_run_that_ends_right_after_an_impact_has_had_it():
    """A ball hits the floor a fifth of a step before the end."""
    ball = pg.Body(
        name="b", joint="free", link=(0, 0, 1.1), shape={"kind": "sphere", "radius": 0.1}
    )
    floor = pg.Contact(name="floor", body="b", restitution=0.5)
    mech = pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,)))
    hit = np.sqrt(2 / G)
    end = hit + 2e-4
    run = pg.simulate(mech, t_end=end, step=end / 452, method="moreau_jean")
    assert run.v[-1, 5] == pytest.approx(0.5 * G * hit - G * 2e-4, abs=1e-6)


@pytest.mark.parametrize("away", [0.0, 10.0, 1e3, 1e5])
def test_depth_does_not_grow_with_the_distance_from_the_origin(away):
    """A dropped box lies at 1e-9 of its size, or at what its coordinates resolve."""
    box = pg.Body(
        name="b", joint="free", link=(0, 0, 0.6), shape={"kind": "box", "size": (0.2,) * 3}
    )
    mech = pg.Mechanism(pg.Model(bodies=(box,), contacts=(pg.Contact(name="c", body="b"),)))
    q, v = mech.home()
    q[0] += away
    run = pg.simulate(mech, q, v, t_end=1.0, step=1e-3, method="moreau_jean", frames=2)
    assert abs(run.q[-1, 2] + 0.5) < 1e-8 + 1e-14 * away
    assert abs(run.v[-1]).max() < 1e-9


@pytest.mark.parametrize("mu", [0.9, 1.5, 2.0])
@pytest.mark.parametrize("degrees", [30, 63])
def test_a_leaning_rod_slides_on_with_much_friction(mu, degrees):
    """Above the friction at which it could be stopped at once, the regular solution is taken.

    Its tip slips towards the lean. The event-driven run integrates the same laws smoothly.
    """
    rod = pg.Body(
        name="rod",
        joint="compound",
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))),
        com=(0, 0, 0.5),
        inertia=np.diag([1 / 12, 1 / 12, 1e-9]),
    )
    tip = pg.Contact(name="tip", body="rod", points=((0, 0, 0),), friction=mu)
    mech = pg.Mechanism(pg.Model(bodies=(rod,), contacts=(tip,)))
    start = [0.0, 0.0, np.radians(degrees)], [1.0, 0.0, 0.0]
    exact = pg.simulate(mech, *start, t_end=0.04, rtol=1e-10, frames=9, estimate=False)
    errors = []
    for step in (1e-3, 1e-4):
        run = pg.simulate(mech, *start, t_end=0.04, step=step, frames=9, method="moreau_jean")
        errors.append(abs(run.q - exact.q).max())
        force = run.contact_force["tip"][1:, 5]
        np.testing.assert_allclose(force, exact.contact_force["tip"][1:, 5], rtol=20 * step)
    assert errors[0] < 1e-4
    assert errors[1] < 0.2 * errors[0]


def test_soft_and_penalty_contacts_are_recorded_beside_rigid_ones():
    """Three balls at rest, one on each law: the floor carries each, and penalty friction sticks."""
    laws = ("complementarity", "soft", "penalty")
    bodies = tuple(
        pg.Body(name=law, joint="free", link=(k, 0, 0.1), shape={"kind": "box", "size": (0.2,) * 3})
        for k, law in enumerate(laws)
    )
    contacts = tuple(
        pg.Contact(name=law, body=law, law=law, friction=0.5, stiffness=None if k == 0 else 1e5)
        for k, law in enumerate(laws)
    )
    model = pg.Model(bodies=bodies, contacts=contacts, gravity=(1.0, 0.0, -G))
    run = pg.simulate(pg.Mechanism(model), t_end=1.0, step=2e-4, frames=11, method="moreau_jean")
    for law in laws:
        assert run.contact_force[law][-1, 5] == pytest.approx(G, rel=1e-3)
        assert run.contact_force[law][-1, 3] == pytest.approx(-1.0, rel=1e-2)
    x = dict(zip(laws, run.q[-1].reshape(3, 7)[:, 0]))
    assert abs(x["complementarity"]) < 1e-9
    assert abs(x["penalty"]) < 1e-4  # held by its spring; a smoothed law creeps on


@pytest.mark.nightly
def test_no_shot_of_the_table_passes():
    """240 shots by speed, size, wall, law and method: 95 % right, the rest told, none through."""
    found = Counter(cell.run()[0] for cell in passing.cells())
    assert found.total() >= 200
    assert found["wrong"] == 0
    assert found["right"] >= 0.95 * found.total()


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1e6])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("high", [3.0, None])
def test_limits_of_all_sizes_are_hit_when_they_must(size, e, high):
    """A slider that falls on its stop and bounces, in closed form: no threshold has a unit."""
    body = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), q=(size,), inertia=np.zeros((3, 3)),
        limits=((0.0, high and high * size),), limit_restitution=(e,),
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=(body,), gravity=(0, 0, -G * size)), t_end=1.0, frames=101)
    fall = np.sqrt(2 / G)
    after = run.t - fall
    rise = np.where(after < 2 * e * fall, e * G * fall * after - 0.5 * G * after**2, np.nan)
    rise = np.where(after < 0, 1 - 0.5 * G * run.t**2, rise)
    rise = np.zeros(101) if e == 0.0 else rise
    known = np.isfinite(rise) & ((e > 0.0) | (after > 0))
    assert known.sum() > 40
    assert np.abs(run.q[known, 0] / size - rise[known]).max() < 1e-9


@pytest.mark.parametrize("step", [1e-3, 1e-4])
@pytest.mark.parametrize("restitution", [0.3, 0.5])
@pytest.mark.parametrize("tilt", [1e-5, 1e-4, 3e-4, 1e-3, 2e-3])
def test_corners_that_land_one_after_the_other_are_hit_so(tilt, restitution, step):
    """A plate that lands nearly flat, as an event-driven run has it."""
    up = 0.1 * np.cos(tilt) + 0.5 * np.sin(tilt) + 0.2
    plate = pg.Body(
        name="b", joint="free", q=(0, 0, up, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0), mass=1.0,
        shape={"kind": "box", "size": (1, 1, 0.2)}, derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", friction=0.0, restitution=restitution)
    model = pg.Model(bodies=[plate], contacts=[floor])
    t_end = (0.4 / 9.81) ** 0.5 + 0.12
    exact = pg.simulate(model, t_end=t_end, method="dop853", estimate=False)
    run = pg.simulate(model, t_end=t_end, step=step)
    error = abs(2 * run["b"][-1, 5] - 2 * exact["b"][-1, 5])
    assert error < max(1e-9, 3 * run.error_estimate)
    assert run.error_estimate < 3e-4


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("tilt", [1e-4, 1e-3, 1e-2])
def test_a_cylinder_that_lands_nearly_flat_hits_with_both_sides_of_its_rim(tilt, restitution):
    """One step, in which it tips from side to side, ends as 20 do."""
    up = 0.1 + 0.5 * tilt + 0.001
    drum = pg.Body(
        name="b", joint="free", q=(0, 0, up, np.cos(tilt / 2), 0, np.sin(tilt / 2), 0), mass=1.0,
        v=(0, 0, 0, 0, 0, -2.0), shape={"kind": "cylinder", "radius": 0.5, "length": 0.2},
        derived=("inertia",),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", friction=0.0, restitution=restitution)
    model = pg.Model(bodies=[drum], contacts=[floor], gravity=(0, 0, 0))
    t_end = 6e-4 + 0.5 * tilt
    one, many = (
        pg.simulate(model, t_end=t_end, step=t_end / n, method="moreau_jean", frames=2,
                    estimate=False)
        for n in (1, 20)
    )  # fmt: skip
    assert many["v.b"][-1, 5] > -1.0
    np.testing.assert_allclose(one["v.b"][-1], many["v.b"][-1], atol=1e-3)

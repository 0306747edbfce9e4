"""Time stepping with contacts: forces by name, loops, three laws, and what runs report."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from ..worlds import ball, box, heaped, on_ground
from .test_phases import FEET, quadruped

G = 9.81


def test_a_loop_and_a_contact_are_solved_together():
    """A four-bar whose coupler lands on the ground: the loop stays closed, the ground carries."""
    hinge = {"axes": ((0, 1, 0),)}
    crank = {"com": (0, 0, -0.2), "inertia": np.diag((0.01, 0.01, 1e-9)), **hinge}
    coupler = {"com": (0.4, 0, 0), "inertia": np.diag((1e-9, 0.1, 0.1)), **hinge}
    bodies = [
        pg.Body(name="a", **crank),
        pg.Body(name="b", parent="a", link=(0, 0, -0.4), **coupler),
        pg.Body(name="c", link=(1, 0, 0), **crank),
    ]
    close = pg.Constraint(name="k", body="b", point=(1, 0, 0), other="c", other_point=(0, 0, -0.4))
    contact = pg.Contact(name="c", body="b", points=((0.4, 0, 0),), friction=0.4, restitution=0.2)
    floor = pg.Ground(steps=(pg.Step(low=(-9, -9), high=(9, 9), height=-0.35),))
    model = pg.Model(bodies=bodies, constraints=(close,), contacts=(contact,), ground=floor)
    run = pg.simulate(model, [1.2, -1.2, 1.2], t_end=2.0, step=1e-3)
    assert run.status.ok
    assert run.constraint_drift[:, 0].max() < 1e-9
    assert run.contact_force["c"][-1, 5] > 1.0
    assert abs(run.v[-1]).max() < 1e-6


def column(count: int) -> pg.Model:
    place = [(0, 0, 0.1 + 0.2 * i, 1, 0, 0, 0) for i in range(count)]
    return heaped(ball(f"b{i}", (0, 0, 0), q=q) for i, q in enumerate(place))


def test_forces_between_every_two_bodies_are_read_by_their_names():
    """A contact of more than twenty bodies is one entry."""
    run = pg.simulate(column(3), t_end=0.02, step=1e-3)
    weight = G * np.array([0, 0, 0, 0, 0, 1.0])
    for k, (a, b) in enumerate((("b2", "b1"), ("b1", "b0"), ("b0", "ground")), start=1):
        np.testing.assert_allclose(run.contact_force[a, b][-1], k * weight, atol=1e-9)
        np.testing.assert_allclose(run.contact_force[b, a][-1], -k * weight, atol=1e-9)
    assert not run.contact_force["b2", "b0"].any()
    assert abs(run.contact_gap["b0", "b1"][-1]) < 1e-9
    np.testing.assert_allclose(run.contact_gap["b0", "b2"][-1], 0.2, atol=1e-9)
    run = pg.simulate(column(21), t_end=2e-3, step=1e-3)
    assert "heap" in run.contact_force
    with pytest.raises(pg.InputError, match=r"20.*'heap'"):
        run.contact_force["b0", "b1"]


def test_the_torque_on_the_other_body_is_about_its_own_origin():
    arm = pg.Body(name="arm", joint="free", q=(0, 0, 0.3, 1, 0, 0, 0), inertia=np.eye(3))
    base = box("base", (0.5, 0, 0), (4, 4, 0.2), joint="weld")
    points = ((1, 0, -0.2), (-1, 0.5, -0.2), (-1, -0.5, -0.2))
    touch = pg.Contact(name="touch", body="arm", other="base", points=points, friction=0.5)
    model = pg.Model(bodies=(arm, base), contacts=(touch,))
    run = pg.simulate(model, v=[0, 0, 0, 1.0, 0, 0], t_end=0.01, step=1e-3)
    on_base = run.contact_force["base", "arm"][-1]
    assert abs(on_base[4]) < 1e-9 < 3 < abs(on_base[1])
    half_a_step = 0.5e-3 * 1.0  # by which the arm moves after the place where the step's force acts
    np.testing.assert_allclose(on_base, run.contacts.wrench[-1, 1], atol=G * half_a_step)


def test_a_point_mass_is_held_and_a_start_under_the_ground_reported():
    """It has no size that rounding could be compared with."""
    body = pg.Body(name="b", joint="prismatic", axes=(0, 0, 1), q=(1.0,), inertia=np.zeros((3, 3)))
    model = on_ground(body, points=((0, 0, 0),), restitution=0.0, friction=0.0)
    assert not pg.simulate(model, t_end=1.0, method="moreau_jean").notices
    buried = pg.simulate(model, [-0.1], t_end=1.0, method="moreau_jean", estimate=False)
    assert "'floor'" in buried.notices[0]


def test_bodies_that_fall_through_the_ground_with_inactive_contacts_are_reported():
    """Contacts of the quadruped act in its scenarios alone."""
    model = pg.Model.load(pgraph_models.path("quadruped"))
    run = pg.simulate(model, t_end=1.0, frames=3, estimate=False)
    (told,) = [text for text in run.notices if "through" in text]
    assert "'left_front_foot'" in told
    assert "scenario" in told
    short = pg.simulate(model, t_end=0.01, frames=3, estimate=False)
    assert not any("through" in text for text in short.notices)


def test_a_wide_plate_that_overlaps_by_a_tenth_of_its_thickness_is_reported():
    plate = box(size=(1.0, 1.0, 1e-3), place=(0, 0, 0.4e-3))
    run = pg.simulate(on_ground(plate), t_end=0.01, step=1e-3, frames=3, estimate=False)
    assert any("floor" in text for text in run.notices)


@pytest.mark.parametrize("pull", [10.5, 13.0])
def test_a_box_under_a_constant_pull_is_not_stiff(pull):
    """No force depends on its state: every rate is zero but for rounding."""
    sled = box(mass=2.0, v=(0, 0, 0, 2, 0, 0))
    back = pg.Wrench(name="w", body="b", force=(-pull, 0, 0), point=(0, 0, -0.1))
    run = pg.simulate(on_ground(sled, friction=0.3).add(back), t_end=1.0)
    assert run.status.ok
    assert not [notice for notice in run.notices if "stiff" in notice]


@pytest.mark.parametrize("away", [0.0, 1e5])
def test_depth_does_not_grow_with_the_distance_from_the_origin(away):
    q = (away, 0, 0, 1, 0, 0, 0)
    model = on_ground(box(place=(0, 0, 0.6), q=q))
    run = pg.simulate(model, t_end=1.0, step=1e-3, method="moreau_jean", frames=2)
    assert abs(run.q[-1, 2] + 0.5) < 1e-8 + 1e-14 * away
    assert abs(run.v[-1]).max() < 1e-9


@pytest.mark.parametrize(("mu", "degrees"), [(0.9, 63), (1.5, 30), (2.0, 63)])
def test_a_leaning_rod_slides_on_with_much_friction(mu, degrees):
    """Above the friction that could stop it at once, as an event-driven run slides on."""
    rod = pg.Body(
        name="rod", joint="compound", com=(0, 0, 0.5), inertia=np.diag([1 / 12, 1 / 12, 1e-9]),
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))),
    )  # fmt: skip
    model = on_ground(rod, points=((0, 0, 0),), friction=mu)
    start = [0.0, 0.0, np.radians(degrees)], [1.0, 0.0, 0.0]
    exact = pg.simulate(model, *start, t_end=0.04, rtol=1e-10, frames=9, estimate=False)
    errors = []
    for step in (1e-3, 1e-4):
        run = pg.simulate(model, *start, t_end=0.04, step=step, frames=9, method="moreau_jean")
        errors.append(abs(run.q - exact.q).max())
        force = run.contacts.wrench[1:, 0, 5]  # of the last step
        np.testing.assert_allclose(force, exact.contact_force["floor"][1:, 5], rtol=20 * step)
    assert errors[0] < 1e-4
    assert errors[1] < 0.2 * errors[0]


def test_contacts_of_three_laws_carry_in_one_run():
    """Three boxes at rest on a slope: the floor carries each, and friction sticks."""
    laws = ("complementarity", "soft", "penalty")
    bodies = [box(law, (k, 0, 0.1)) for k, law in enumerate(laws)]
    contacts = [
        pg.Contact(name=law, body=law, law=law, friction=0.5, stiffness=(k and 1e5) or None)
        for k, law in enumerate(laws)
    ]
    model = pg.Model(bodies=bodies, contacts=contacts, gravity=(1.0, 0.0, -G))
    run = pg.simulate(model, t_end=1.0, step=2e-4, frames=11, method="moreau_jean", estimate=False)
    for law in laws:
        assert run.contact_force[law][-1, 5] == pytest.approx(G, rel=1e-3)
        assert run.contact_force[law][-1, 3] == pytest.approx(-1.0, rel=1e-2)
    x = dict(zip(laws, run.q[-1].reshape(3, 7)[:, 0]))
    assert abs(x["complementarity"]) < 1e-9
    assert abs(x["penalty"]) < 1e-4  # held by its spring; a smoothed law creeps on


def test_the_quadruped_drops_and_stands():
    mech, q, v = quadruped(0.7, drop=0.1)
    servos = [f.model_copy(update={"kp": 2000.0, "kd": 80.0}) for f in mech.model.forces]
    mech = pg.Mechanism(mech.model.replace(forces=servos))
    run = pg.simulate(mech, q, v, t_end=5.0, step=1e-3, estimate=False)
    assert run.status.ok
    total = sum(run.contact_force[f][:, 3:] for f in FEET)
    assert abs(run.v[-1]).max() < 1e-4
    assert total[-1, 1] == pytest.approx(33 * G, rel=1e-4)
    for f in FEET:
        force = run.contact_force[f][:, 3:]
        landed = int(np.argmax(force[:, 1] > 0))
        assert run.t[landed] == pytest.approx(np.sqrt(2 * 0.1 / G), abs=0.01)
        assert force[:, 1].min() >= 0
        assert np.all(np.hypot(force[:, 0], force[:, 2]) <= 0.7 * force[:, 1] + 1e-9)
    drifts = []
    for step in (1e-3, 2.5e-4):
        run = pg.simulate(mech, q, v, t_end=0.3, step=step, frames=11, estimate=False)
        ledger = run.energy - run.work + run.dissipation
        drifts.append(abs(ledger - ledger[0]).max())
    assert (
        max(drifts) < 1e-3
    )  # of the 32 J that the fall brings; impacts leave no order of the step


def test_dominoes_that_jam_follow_the_laws_of_contact():
    """A row that falls: friction pushes an edge into its neighbour, which stops it by sticking."""
    thin = {"size": (0.02, 0.1, 0.2), "mass": 0.1}
    bodies = [box(f"d{k}", (0.08 * k, 0, 0.1), **thin) for k in range(12)]
    v = np.zeros(72)
    v[[1, 3]] = 6, 0.6  # of the first one, which begins to tip
    given = {"t_end": 1.2, "step": 1e-3, "method": "moreau_jean", "estimate": False}
    run = pg.simulate(heaped(bodies, friction=0.4), None, v, **given)
    assert run.counters["contact_fallbacks"] < 5  # 14 where a jam ends Newton's method
    assert run["d11"][-1, 2] < 0.06


@pytest.mark.parametrize("below", [1, 4])
def test_a_heavy_box_that_moves_on_light_ones_follows_the_laws_of_contact(below):
    """1e6 kg on 1 kg at random velocities, from which Newton's method alone does not converge."""
    dice = np.random.default_rng(0)
    masses = [1.0] * below + [1e6]
    bodies = [box(f"b{k}", (0, 0, 0.1 + 0.2 * k), mass=m) for k, m in enumerate(masses)]
    mech = pg.Mechanism(heaped(bodies, friction=0.5))
    given = {"t_end": 1e-3, "step": 1e-3, "method": "moreau_jean", "estimate": False}
    for _ in range(20):
        v = dice.normal(size=6 * len(masses)) * 10 ** dice.uniform(-3, 0)
        run = pg.simulate(mech, None, v, **given)
        assert run.counters["contact_fallbacks"] == 0

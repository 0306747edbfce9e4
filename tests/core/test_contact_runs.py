"""Contacts and limits in time stepping, against closed forms and laws."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from .test_phases import FEET, quadruped

G = 9.81


def falling(shape, height, **contact):
    """A free body above the ground."""
    body = pg.Body(name="b", joint="free", link=(0, 0, height), shape=shape)
    floor = pg.Contact(name="floor", body="b", **contact)
    return pg.Mechanism(pg.Model(bodies=(body,), contacts=(floor,)))


@pytest.mark.parametrize("e", [0.0, 0.5, 0.8])
def test_a_ball_bounces_to_the_height_that_its_restitution_leaves(e):
    """To the first order of the step."""
    mech = falling({"kind": "sphere", "radius": 0.1}, 1.1, restitution=e)
    errors = []
    for step in (1e-3, 5e-4):
        run = pg.simulate(mech, t_end=1.0, step=step, frames=1001)
        assert run.status.ok
        assert run.header["method"] == "moreau_jean"
        after = run.t > 0.5
        height = run.body_pose[after, 0, 2].max() - 0.1
        errors.append(abs(height - e * e))
    assert max(errors) < 0.01
    assert errors[1] < 0.8 * errors[0] + 1e-6


def test_a_ball_that_came_to_rest_stays_and_is_carried():
    """After the Zeno time of e = 0.5 the ground carries the weight, to rounding of the solver."""
    mech = falling({"kind": "sphere", "radius": 0.1}, 1.1, restitution=0.5)
    run = pg.simulate(mech, t_end=2.0, step=1e-3)
    at_rest = run.t > 1.4
    np.testing.assert_allclose(run.contact_force["floor"][at_rest, 5], G, rtol=1e-9)
    assert abs(run.v[at_rest]).max() < 1e-9
    assert abs(run.contact_gap["floor"][at_rest]).max() < 1e-5
    np.testing.assert_allclose(run.joint_force[at_rest], 0.0, atol=1e-8)  # nothing else holds it


@pytest.mark.parametrize(("degrees", "acceleration"), [(16, 0.0), (17, 0.05376152653083388)])
def test_a_block_sticks_or_slides_on_a_slope_as_coulomb_says(degrees, acceleration):
    """mu = 0.3 holds up to 16.7 degrees, and holds exactly: no creep."""
    angle = np.radians(degrees)
    body = pg.Body(
        name="b", joint="free", link=(0, 0, 0.1), shape={"kind": "box", "size": (0.2,) * 3}
    )
    model = pg.Model(
        bodies=(body,),
        gravity=(G * np.sin(angle), 0, -G * np.cos(angle)),
        contacts=(pg.Contact(name="c", body="b", friction=0.3),),
    )
    run = pg.simulate(pg.Mechanism(model), t_end=1.0, step=1e-3)
    assert run.v[-1, 3] == pytest.approx(acceleration, abs=1e-9)


def test_a_sliding_block_stops_where_it_must():
    mech = falling({"kind": "box", "size": (0.2,) * 3}, 0.1, friction=0.3)
    q, v = mech.home()
    v[3] = 3.0
    run = pg.simulate(mech, q, v, t_end=2.0, step=1e-3)
    reference = json.loads((pgraph_models.CASES / "sliding_block_coulomb.json").read_text())[
        "reference"
    ]
    assert run.q[-1, 0] == pytest.approx(reference["flat"]["stop_x"], abs=1e-5)
    assert abs(run.v[-1]).max() < 1e-12
    assert run.energy_drift < 0.05


@pytest.mark.parametrize(("mu", "angle", "way"), [(0.3, 0.42174855, -1), (0.5, 0.90722648, 1)])
def test_a_falling_rod_slips_at_its_closed_form_angle(mu, angle, way):
    """To the first order of the step, backwards for small friction and forwards for large."""
    rod = pg.Body(
        name="rod",
        joint="compound",
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))),
        com=(0, 0, 0.5),
        inertia=np.diag([1 / 12, 1 / 12, 1e-9]),
        q=(0, 0, 0.01),
    )
    tip = pg.Contact(name="tip", body="rod", points=((0, 0, 0),), friction=mu)
    mech = pg.Mechanism(pg.Model(bodies=(rod,), contacts=(tip,)))
    for step in (1e-3, 5e-4):
        frames = round(1.5 / step) + 1
        run = pg.simulate(mech, t_end=1.5, step=step, frames=frames, estimate=False)
        slips = int(np.argmax(run.contact_slip["tip"] > 1e-6))
        assert run.q[slips, 2] == pytest.approx(angle, abs=30 * step)
        assert np.sign(run.v[slips + 3, 0]) == way


def test_a_loop_and_a_contact_are_solved_together():
    """A four-bar whose coupler lands on the ground: the loop stays closed, the ground carries."""
    crank = {"axes": ((0, 1, 0),), "com": (0, 0, -0.2), "inertia": np.diag((0.01, 0.01, 1e-9))}
    bodies = [
        pg.Body(name="a", **crank),
        pg.Body(
            name="b", parent="a", axes=((0, 1, 0),), link=(0, 0, -0.4), com=(0.4, 0, 0),
            inertia=np.diag((1e-9, 0.1, 0.1)),
        ),
        pg.Body(name="c", link=(1, 0, 0), **crank),
    ]  # fmt: skip
    close = pg.Constraint(name="k", body="b", point=(1, 0, 0), other="c", other_point=(0, 0, -0.4))
    model = pg.Model(
        bodies=bodies,
        constraints=(close,),
        contacts=(
            pg.Contact(name="c", body="b", points=((0.4, 0, 0),), friction=0.4, restitution=0.2),
        ),
        ground=pg.Ground(steps=(pg.Step(low=(-9, -9), high=(9, 9), height=-0.35),)),
    )
    run = pg.simulate(pg.Mechanism(model), [1.2, -1.2, 1.2], t_end=2.0, step=1e-3)
    assert run.status.ok
    assert run.constraint_drift[:, 0].max() < 1e-9
    assert run.contact_force["c"][-1, 5] > 1.0
    assert abs(run.v[-1]).max() < 1e-6


def heap(count: int) -> pg.Model:
    """A column of balls on a floor."""
    ball = {"kind": "sphere", "radius": 0.1}
    bodies = [
        pg.Body(name=f"b{i}", joint="free", q=(0, 0, 0.1 + 0.2 * i, 1, 0, 0, 0), shape=ball)
        for i in range(count)
    ]
    contacts = (pg.Contact(name="floor", body="*"), pg.Contact(name="heap", body="*", other="*"))
    return pg.Model(bodies=bodies, contacts=contacts)


def test_forces_between_every_two_bodies_are_read_by_their_names():
    run = pg.simulate(heap(3), t_end=0.02, step=1e-3)
    weight = 9.81 * np.array([0, 0, 0, 0, 0, 1.0])
    for k, (a, b) in enumerate((("b2", "b1"), ("b1", "b0"), ("b0", "ground")), start=1):
        np.testing.assert_allclose(run.contact_force[a, b][-1], k * weight, atol=1e-9)
        np.testing.assert_allclose(run.contact_force[b, a][-1], -k * weight, atol=1e-9)
    assert not run.contact_force["b2", "b0"].any()
    assert abs(run.contact_gap["b0", "b1"][-1]) < 1e-9
    np.testing.assert_allclose(run.contact_gap["b0", "b2"][-1], 0.2, atol=1e-9)


def test_the_torque_on_the_other_body_is_about_its_own_origin():
    arm = pg.Body(name="arm", joint="free", q=(0, 0, 0.3, 1, 0, 0, 0), inertia=np.eye(3))
    base = pg.Body(
        name="base", joint="weld", link=(0.5, 0, 0), shape={"kind": "box", "size": (4, 4, 0.2)}
    )
    points = ((1, 0, -0.2), (-1, 0.5, -0.2), (-1, -0.5, -0.2))
    touch = pg.Contact(name="touch", body="arm", other="base", points=points, friction=0.5)
    model = pg.Model(bodies=(arm, base), contacts=(touch,))
    run = pg.simulate(model, v=[0, 0, 0, 1.0, 0, 0], t_end=0.01, step=1e-3)
    on_base = run.contact_force["base", "arm"][-1]
    assert abs(on_base[4]) < 1e-9 < 3 < abs(on_base[1])
    half_a_step = 0.5e-3 * 1.0  # by which the arm moves after the place where the step's force acts
    np.testing.assert_allclose(on_base, run.contacts.wrench[-1, 1], atol=9.81 * half_a_step)


def test_contacts_of_more_than_twenty_bodies_are_one_entry():
    run = pg.simulate(heap(21), t_end=2e-3, step=1e-3)
    assert "heap" in run.contact_force
    with pytest.raises(pg.InputError, match=r"20.*'heap'"):
        run.contact_force["b0", "b1"]


def test_a_point_mass_penetrates_by_a_part_of_how_far_it_moved():
    """It has no size that rounding could be compared with; a start under the ground is reported."""
    body = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), q=(1.0,), inertia=np.zeros((3, 3))
    )
    floor = pg.Contact(name="c", body="b", points=((0, 0, 0),), restitution=0.0)
    model = pg.Model(bodies=(body,), contacts=(floor,))
    assert not pg.simulate(model, t_end=1.0, method="moreau_jean").notices
    buried = pg.simulate(model, [-0.1], t_end=1.0, method="moreau_jean", estimate=False)
    assert "'c'" in buried.notices[0]


def test_bodies_that_fall_through_the_ground_with_inactive_contacts_are_reported():
    """Contacts of the quadruped act in its scenarios alone."""
    quadruped = pg.Model.load(pgraph_models.path("quadruped"))
    run = pg.simulate(quadruped, t_end=1.0, frames=3, estimate=False)
    (told,) = [text for text in run.notices if "through" in text]
    assert "'left_front_foot'" in told
    assert "scenario" in told
    short = pg.simulate(quadruped, t_end=0.01, frames=3, estimate=False)
    assert not any("through" in text for text in short.notices)


@pytest.mark.parametrize("pull", [10.5, 13.0])
def test_a_box_under_a_constant_pull_is_not_stiff(pull):
    """No force depends on its state: every rate is zero but for rounding."""
    box = pg.Body(
        name="b", joint="free", link=(0, 0, 0.1), mass=2.0, inertia=np.eye(3) * 0.013,
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.2)), v=(0, 0, 0, 2, 0, 0),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", friction=0.3)
    back = pg.Wrench(name="w", body="b", force=(-pull, 0, 0), point=(0, 0, -0.1))
    run = pg.simulate(pg.Model(bodies=[box], contacts=[floor]).add(back), t_end=1.0)
    assert run.status.ok
    assert not [notice for notice in run.notices if "stiff" in notice]


@pytest.mark.parametrize("away", [0.0, 1e5])
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


@pytest.mark.parametrize(("mu", "degrees"), [(0.9, 63), (1.5, 30), (2.0, 63)])
def test_a_leaning_rod_slides_on_with_much_friction(mu, degrees):
    """Above the friction that could stop it at once, as an event-driven run slides on."""
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
    """Three boxes at rest, one on each law: the floor carries each, and friction sticks."""
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


def test_a_wide_plate_that_overlaps_by_a_tenth_of_its_thickness_is_reported():
    plate = pg.Body(
        name="plate", joint="free", q=(0, 0, 0.4e-3, 1, 0, 0, 0),
        shape={"kind": "box", "size": (1.0, 1.0, 1e-3)}, derived=("inertia",),
    )  # fmt: skip
    model = pg.Model(bodies=(plate,), contacts=(pg.Contact(name="lies", body="plate"),))
    run = pg.simulate(model, t_end=0.01, step=1e-3, frames=3, estimate=False)
    assert any("lies" in text for text in run.notices)


def test_the_quadruped_drops_and_stands():
    """Its weight is on the ground, which only pushes, within the cone; the ledger closes."""
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
    assert drifts[0] < 0.1
    assert drifts[1] < 0.5 * drifts[0]


def test_a_pendulum_stops_at_its_limit():
    """Restitution 0.6 at 0.5 rad: it comes to rest there, and the limit carries its weight."""
    rod = pg.Body(
        name="rod", axes=((0, 1, 0),), com=(0, 0, -0.5), inertia=np.diag([1 / 12, 1 / 12, 1e-9]),
        q=1.5, limits=(0.5, None), limit_restitution=0.6,
    )  # fmt: skip
    run = pg.simulate(pg.Model(bodies=(rod,)), t_end=3.0, step=5e-4, frames=3001, estimate=False)
    first = int(np.argmax(run.v[:, 0] > 0))
    assert run.t[first] == pytest.approx(0.37794648, abs=2e-3)  # four steps
    assert run.v[first, 0] == pytest.approx(0.6 * 4.87293, rel=5e-3)
    assert run.q[-1, 0] == pytest.approx(0.5, abs=1e-4)
    assert run.contacts.limit["rod low limit"][-1] == pytest.approx(G / 2 * np.sin(0.5), rel=1e-5)

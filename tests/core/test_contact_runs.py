"""Contacts, limits and impacts in time stepping, against closed forms and laws."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.distance import pdist

import pgraph_core as pg
import pgraph_models

G = 9.81
FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")


def falling(shape, height, **contact):
    """A free body above the ground, and what `simulate` takes."""
    body = pg.Body(name="b", joint="free", link=(0, 0, height), shape=shape)
    floor = pg.Contact(name="floor", body="b", **contact)
    return pg.Mechanism(pg.Model(bodies=(body,), contacts=(floor,)))


@pytest.mark.parametrize("e", [0.0, 0.5, 0.8])
def test_a_ball_bounces_to_the_height_that_its_restitution_leaves(e):
    """e² of the first height, to the first order of the step."""
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


SLOPES = [(10, 0.0), (16, 0.0), (17, 0.05376152653083388)]


@pytest.mark.parametrize(("degrees", "acceleration"), SLOPES)
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
        run = pg.simulate(mech, t_end=1.5, step=step, frames=round(1.5 / step) + 1)
        slips = int(np.argmax(run.contact_slip["tip"] > 1e-6))
        assert run.q[slips, 2] == pytest.approx(angle, abs=30 * step)
        assert np.sign(run.v[slips + 3, 0]) == way


def test_a_pendulum_stops_at_its_limit():
    """Restitution 0.6 at 0.5 rad: it comes to rest there, where the limit carries its weight."""
    rod = pg.Body(
        name="rod",
        axes=((0, 1, 0),),
        com=(0, 0, -0.5),
        inertia=np.diag([1 / 12, 1 / 12, 1e-9]),
        q=1.5,
        limits=(0.5, None),
        limit_restitution=0.6,
    )
    run = pg.simulate(pg.Mechanism(pg.Model(bodies=(rod,))), t_end=3.0, step=5e-4, frames=3001)
    first = int(np.argmax(run.v[:, 0] > 0))
    assert run.t[first] == pytest.approx(0.37794648, abs=2e-3)  # four steps
    assert run.v[first, 0] == pytest.approx(0.6 * 4.87293, rel=5e-3)
    assert run.q[-1, 0] == pytest.approx(0.5, abs=1e-4)
    assert run.contacts.limit["rod low limit"][-1] == pytest.approx(G / 2 * np.sin(0.5), rel=1e-5)


@pytest.mark.parametrize("law", ["soft", "penalty"])
def test_compliant_contacts_carry_the_weight(law):
    mech = falling({"kind": "sphere", "radius": 0.1}, 0.101, law=law, friction=0.5)
    run = pg.simulate(mech, t_end=2.0, step=1e-4)
    assert run.header["method"] == "rk4"
    assert run.contact_force["floor"][-1, 5] == pytest.approx(G, rel=1e-3)
    assert run.energy_drift < 1e-3


def test_penalty_friction_sticks_on_a_slope():
    """Its anchors hold: a smoothed law would creep down at some mm/s."""
    angle = np.radians(16)
    body = pg.Body(
        name="b", joint="free", link=(0, 0, 0.1), shape={"kind": "box", "size": (0.2,) * 3}
    )
    model = pg.Model(
        bodies=(body,),
        gravity=(G * np.sin(angle), 0, -G * np.cos(angle)),
        contacts=(pg.Contact(name="c", body="b", law="penalty", friction=0.3, stiffness=1e5),),
    )
    run = pg.simulate(pg.Mechanism(model), t_end=2.0, step=2e-4)
    assert abs(run.v[-1, 3:]).max() < 1e-6
    assert abs(run.q[-1, 0]) < 1e-3


def dropped(mu):
    """The quadruped 10 cm above the ground, its joints held by servos."""
    model = pg.Model.load(pgraph_models.path("quadruped"))
    hold = {f.body: f.torque for f in model.scenario("stand").forces}
    servos = tuple(
        pg.Force(name=f"servo {b.name}", kind="servo", body=b.name, kp=2000.0, kd=80.0,
                 torque=hold.get(b.name, 0.0))
        for b in model.bodies if b.joint == "revolute"
    )  # fmt: skip
    contacts = tuple(
        pg.Contact(name=f, body=f, points=(model.body(f).tip_point,), friction=mu) for f in FEET
    )
    mech = pg.Mechanism(
        model.replace(constraints=(), scenarios=(), forces=servos, contacts=contacts)
    )
    q, v = mech.home()
    q[1] += 0.1
    return mech, q, v


def test_the_quadruped_drops_and_stands():
    mech, q, v = dropped(0.7)
    run = pg.simulate(mech, q, v, t_end=5.0, step=1e-3)
    assert run.status.ok
    total = sum(run.contact_force[f][:, 3:] for f in FEET)
    assert abs(run.v[-1]).max() < 1e-6
    assert total[-1, 1] == pytest.approx(33 * G, rel=1e-6)
    for f in FEET:
        landed = int(np.argmax(run.contact_force[f][:, 4] > 0))
        assert run.t[landed] == pytest.approx(np.sqrt(2 * 0.1 / G), abs=0.01)
        assert run.contact_force[f][:, 4].min() >= 0  # the ground cannot pull
        tangential = np.hypot(run.contact_force[f][:, 3], run.contact_force[f][:, 5])
        assert np.all(tangential <= 0.7 * run.contact_force[f][:, 4] + 1e-9)


def test_feet_slide_on_ice():
    mech, q, v = dropped(0.05)
    run = pg.simulate(mech, q, v, t_end=1.0, step=1e-3)
    assert max(run.contact_slip[f].max() for f in FEET) > 0.05


def test_a_drop_closes_its_energy_ledger_as_the_step_shrinks():
    mech, q, v = dropped(0.7)
    drifts = []
    for step in (1e-3, 2.5e-4):
        run = pg.simulate(mech, q, v, t_end=0.3, step=step, frames=11)
        ledger = run.energy - run.work + run.dissipation
        drifts.append(abs(ledger - ledger[0]).max())
    assert drifts[0] < 0.1
    assert drifts[1] < 0.5 * drifts[0]


def test_a_loop_and_a_contact_are_solved_together():
    """A four-bar whose coupler lands on the ground: the loop stays closed, the ground carries."""
    from .test_constraints import parallelogram

    model = parallelogram().replace(
        contacts=(
            pg.Contact(name="c", body="b", points=((0.4, 0, 0),), friction=0.4, restitution=0.2),
        ),
        ground=pg.Ground(steps=(pg.Step(low=(-9, -9), high=(9, 9), height=-0.45),)),
    )
    run = pg.simulate(pg.Mechanism(model), [1.2, -1.2, 1.2], t_end=2.0, step=1e-3)
    assert run.status.ok
    assert run.constraint_drift[:, 0].max() < 1e-9
    assert run.contact_force["c"][-1, 5] > 1.0
    assert abs(run.v[-1]).max() < 1e-6


HEAPS = [
    pytest.param(200, 6, 3.0),
    pytest.param(1000, 12, 4.0, marks=pytest.mark.nightly),
]


@pytest.mark.parametrize(("count", "side", "t_end"), HEAPS)
def test_spheres_fall_into_a_heap_between_walls(count, side, t_end):
    """They come to rest without sinking in, and floor and walls carry all of them."""
    r = 0.05
    half = 2.1 * r * side / 2
    rng = np.random.default_rng(1)
    inertia = np.eye(3) * 0.4 * r * r
    places = [(k % side, k // side % side, k // side**2) for k in range(count)]
    balls = [
        pg.Body(name=f"s{k}", joint="free", inertia=inertia, shape={"kind": "sphere", "radius": r},
                link=tuple(2.1 * r * (np.array(p) + 0.5) - (half, half, 0)
                           + 0.04 * r * rng.normal(size=3)))
        for k, p in enumerate(places)
    ]  # fmt: skip
    far, height = half + 0.05, 3.0 * r * count / side**2
    walls = [
        pg.Body(name=f"w{k}", joint="weld", link=(*(far * np.array(way)), height / 2),
                shape={"kind": "box", "size": (0.1 if way[0] else 3 * far,
                                               0.1 if way[1] else 3 * far, height)})
        for k, way in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1)))
    ]  # fmt: skip
    contacts = (
        pg.Contact(name="floor", body="*", friction=0.5),
        pg.Contact(name="heap", body="*", other="*", friction=0.5),
    )
    model = pg.Model(bodies=(*balls, *walls), contacts=contacts)
    run = pg.simulate(pg.Mechanism(model), t_end=t_end, step=2e-3, frames=3)
    assert run.status.ok
    centres = run.body_pose[-1, :count, :3]
    assert 2 * r - pdist(centres).min() < 1e-3 * r
    assert r - centres[:, 2].min() < 1e-3 * r
    fallen = count * G * height / 4
    assert run.kinetic_energy[-1] < 1e-4 * fallen
    assert run.contacts.wrench[-1, :count, 5].sum() == pytest.approx(count * G, rel=0.02)


@pytest.mark.parametrize("masses", [(1, 1, 1), (1, 1e4), (1e4, 1), (1, 10, 100, 1000)])
def test_stacks_of_any_mass_ratio_stand(masses):
    """Four points under each box are redundant; a heavy box on a light one stalls plain sweeps."""
    r = 0.1
    boxes = tuple(
        pg.Body(name=f"b{i}", joint="free", mass=m, inertia=np.eye(3) * m * 0.006,
                link=(0, 0, r + 2 * r * i), shape={"kind": "box", "size": (2 * r,) * 3})
        for i, m in enumerate(masses)
    )  # fmt: skip
    contacts = tuple(
        pg.Contact(name=f"c{i}", body=f"b{i}", other=f"b{i - 1}" if i else "ground")
        for i in range(len(masses))
    )
    run = pg.simulate(pg.Mechanism(pg.Model(bodies=boxes, contacts=contacts)), t_end=0.3)
    assert not run.notices
    assert abs(run.v[-1]).max() < 1e-9
    for i in range(len(masses)):
        carried = sum(masses[i:]) * G
        assert run.contact_force[f"c{i}"][-1, 5] == pytest.approx(carried, rel=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_impacts_with_friction_never_raise_the_energy(seed):
    """Newton's restitution with friction can (by 75 % at e = 0.88, mu = 0.77): then e = 0."""
    rng = np.random.default_rng(seed)
    inertia = np.diag([1 / 12, 1 / 12, 1e-9])
    upper = pg.Body(name="a", axes=((0, 1, 0),), com=(0, 0, -0.5), inertia=inertia)
    lower = pg.Body(name="b", parent="a", axes=((0, 1, 0),), link=(0, 0, -1), com=(0, 0, -0.5),
                    inertia=inertia)  # fmt: skip
    tip = pg.Contact(name="tip", body="b", points=((0, 0, -1),), restitution=0.88, friction=0.77)
    floor = pg.Ground(steps=(pg.Step(low=(-9, -9), high=(9, 9), height=-1.6),))
    mech = pg.Mechanism(pg.Model(bodies=(upper, lower), contacts=(tip,), ground=floor))
    q = np.array([rng.uniform(0.8, 1.5), rng.uniform(-0.3, 0.3)])
    run = pg.simulate(mech, q, 3 * rng.normal(size=2), t_end=2.0, step=1e-3, frames=2001)
    assert np.diff(run.energy).max() < 0.03  # of some 20 J: what stepping without impacts gains


def test_a_scene_without_contacts_runs_none_of_their_code():
    mech = pg.Mechanism(pg.Model.serial(3))
    run = pg.simulate(mech, t_end=0.1)
    assert "contact_fallbacks" not in run.counters
    assert "no contact: nothing is looked for that may touch" in run.left_out
    assert "no rigid contact, no joint limit: no impacts" in run.left_out


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


def test_contacts_of_more_bodies_than_can_be_told_apart_say_so():
    run = pg.simulate(heap(21), t_end=2e-3, step=1e-3)
    assert "heap" in run.contact_force
    with pytest.raises(pg.InputError, match="of more bodies than 20 is one entry, 'heap'"):
        run.contact_force["b0", "b1"]


def test_a_point_mass_penetrates_by_a_part_of_how_far_it_moved():
    """It has no size that rounding could be compared with; a start under the ground is said."""
    body = pg.Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), q=(1.0,), inertia=np.zeros((3, 3))
    )
    floor = pg.Contact(name="c", body="b", points=((0, 0, 0),), restitution=0.0)
    model = pg.Model(bodies=(body,), contacts=(floor,))
    assert not pg.simulate(model, t_end=1.0, method="moreau_jean").notices
    buried = pg.simulate(model, [-0.1], t_end=1.0, method="moreau_jean", estimate=False)
    assert "of how far it moved" in buried.notices[0]


def test_bodies_that_fall_through_the_ground_with_inactive_contacts_are_said():
    """Contacts of the quadruped act in its scenarios alone."""
    quadruped = pg.Model.load(pgraph_models.path("quadruped"))
    run = pg.simulate(quadruped, t_end=1.0, frames=3, estimate=False)
    (said,) = [text for text in run.notices if "went through the ground" in text]
    assert "'left_front_foot'" in said
    assert "choose scenario=" in said
    short = pg.simulate(quadruped, t_end=0.01, frames=3, estimate=False)
    assert not any("went through" in text for text in short.notices)


@pytest.mark.parametrize("pull", [10.5, 11.5, 13.0])
def test_a_box_under_a_constant_pull_is_not_stiff(pull):
    """No force of it depends on its state: every rate is zero, and rounding is none."""
    box = pg.Body(
        name="b", joint="free", link=(0, 0, 0.1), mass=2.0, inertia=np.eye(3) * 0.013,
        shape=pg.Shape(kind="box", size=(0.2, 0.2, 0.2)), v=(0, 0, 0, 2, 0, 0),
    )  # fmt: skip
    floor = pg.Contact(name="c", body="b", friction=0.3)
    back = pg.Wrench(name="w", body="b", force=(-pull, 0, 0), point=(0, 0, -0.1))
    run = pg.simulate(pg.Model(bodies=[box], contacts=[floor]).add(back), t_end=1.0)
    assert run.status.ok
    assert not [notice for notice in run.notices if "stiff" in notice]

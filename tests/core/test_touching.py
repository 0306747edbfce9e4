"""Which bodies of a model touch, where, and the defaults of the contact laws."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg

from ..worlds import ball, box, on_ground

pytestmark = pytest.mark.quick

G = 9.81
BALL = {"kind": "sphere", "radius": 0.1}


def gap(model, q, name):
    run = pg.simulate(model, q, t_end=1e-9, step=1e-9, frames=2, estimate=False)
    return run.contact_gap[name][0]


@pytest.mark.parametrize("count", [3, 22])
def test_bodies_that_a_joint_connects_touch_only_in_a_contact_that_names_both(count):
    """Overlapping rods of a straight chain do not push each other, unless a contact names them."""
    model = pg.Model.serial(count).replace(gravity=(0, 0, 0))
    for name in model.row:
        model = model.edit(name, shape={"kind": "box", "size": (0.3, 0.1, 0.1)})
    every = pg.Contact(name="all", body="*", other="*", law="penalty")
    named = pg.Contact(name="named", body="1", other="2", law="penalty")
    options = {"t_end": 1e-3, "step": 1e-4, "method": "rk4", "frames": 2, "estimate": False}
    joined = pg.simulate(model.replace(contacts=(every,)), **options)
    assert not joined.contacts.wrench.any()
    pushed = pg.simulate(model.replace(contacts=(every, named)), **options)
    assert abs(pushed.contact_force["named"][-1, 3:]).max() > 0


def test_points_and_shapes_touch_where_the_body_has_them():
    """On a body that is turned at home, hinged and moved: heights from its pose."""
    turn = Rotation.from_euler("x", 0.4)
    half, place = np.array((0.3, 0.1, 0.05)), np.array((0.2, 0.1, -0.1))
    shape = {
        "kind": "box", "size": tuple(2 * half), "position": tuple(place),
        "rotation": tuple(turn.as_quat(scalar_first=True)),
    }  # fmt: skip
    foot = pg.Contact(name="foot", body="1", points=((0.2, 0, 0), (0.2, 0, -0.1)))
    model = pg.Model.serial(2).edit("1", rotation=(0.8, 0.6, 0, 0)).edit("2", shape=shape)
    model = model.replace(contacts=(foot, pg.Contact(name="box", body="2")))
    mech, q = pg.Mechanism(model), np.array([0.4, -0.7])
    position, rotation = mech.pose(q, "1")
    heights = [(position + rotation @ np.array(p))[2] for p in foot.points]
    assert gap(model, q, "foot") == pytest.approx(min(heights), abs=1e-12)
    position, rotation = mech.pose(q, "2")
    lowest = (position + rotation @ place)[2] - abs((rotation @ turn.as_matrix())[2]) @ half
    assert gap(model, q, "box") == pytest.approx(lowest, abs=1e-12)


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_steps_lie_where_the_description_says(up):
    step = pg.Step(low=(1, 10), high=(2, 20), height=0.3)
    body, floor = pg.Body(name="a", joint="free", shape=BALL), pg.Contact(name="c", body="a")
    model = pg.Model(up=up, bodies=(body,), contacts=(floor,), ground=pg.Ground(steps=(step,)))
    level = [k for k in range(3) if "xyz"[k] != up]
    q = np.array([0, 0, 0, 1.0, 0, 0, 0])
    q["xyz".index(up)] = 0.35
    q[level] = 1.5, 15.0
    assert gap(model, q, "c") == pytest.approx(-0.05)
    q[level] = 15.0, 1.5
    assert gap(model, q, "c") == pytest.approx(0.25)


@pytest.mark.parametrize("mass", [1.0, 1e3])
def test_a_penalty_contact_without_stiffness_gives_way_by_a_part_of_the_size(mass):
    """The weight presses it in by 1e-4 of the radius of gyration, over sqrt(3/2)."""
    model = on_ground(ball(mass=mass), law="penalty", restitution=0.1)
    run = pg.simulate(model, t_end=0.3, estimate=False)
    size = np.sqrt(1.5 * 0.004)
    assert -run.contact_gap["floor"][-1] == pytest.approx(1e-4 * size, rel=1e-2)
    assert run.contact_force["floor"][-1, 5] == pytest.approx(mass * G, rel=1e-2)


@pytest.mark.parametrize("law", ["complementarity", "soft", "penalty"])
def test_friction_and_restitution_default_to_those_of_the_ground(law):
    """A ball thrown at the ground leaves with its restitution and slides with its friction."""
    body = pg.Body(
        name="b", joint="compound", motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        link=(0, 0, 0.101), v=(5.0, -1.0), mass=1.0, inertia=np.eye(3) * 0.01, shape=BALL,
    )  # fmt: skip
    contacts = (pg.Contact(name="c", body="b", law=law),)
    ground = {"friction": 0.3, "restitution": 0.2}
    model = pg.Model(bodies=(body,), contacts=contacts, ground=ground, gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.01, estimate=False)
    assert run.v[-1, 1] == pytest.approx(0.2, abs=5e-3)
    assert 5.0 - run.v[-1, 0] == pytest.approx(0.3 * 1.2, rel=2e-2)


@pytest.mark.parametrize("law", ["soft", "penalty"])
@pytest.mark.parametrize("mass", [1e-3, 1e3])
def test_a_wall_welded_to_the_ground_has_the_stiffness_of_the_ground(law, mass):
    """Whatever its mass, on a base that is welded as well."""
    base = pg.Body(name="base", joint="weld", mass=mass)
    wall = box("wall", (0, 0, -0.5), (1, 1, 1), parent="base", joint="weld", mass=mass)
    heights = []
    for other in ("ground", "wall"):
        hit = pg.Contact(name="hit", body="b", other=other, law=law, restitution=0.4)
        model = pg.Model(bodies=(ball(place=(0, 0, 0.11), mass=2.0), base, wall), contacts=(hit,))
        run = pg.simulate(model, t_end=0.1, step=1e-5, method="rk4", frames=21, estimate=False)
        heights.append(run.q[:, 2])
    np.testing.assert_allclose(*heights, atol=1e-9)


def test_limits_are_named_by_their_coordinates():
    motions = (("ball", (0, 0, 1)), ("translate", (1, 0, 0)), ("rotate", (0, 0, 1)))
    solid = {"inertia": (0.01, 0.01, 0.01)}
    bodies = (
        pg.Body(
            name="a",
            joint="compound",
            motions=motions,
            limits=(None, (0, None), (-1, 2)),
            armature=(0, 0, 1),
            **solid,
        ),
        pg.Body(name="b", parent="a", limits=(None, 0.5), limit_restitution=0.6, **solid),
    )
    run = pg.simulate(pg.Model(bodies=bodies), t_end=1e-3, step=1e-3, frames=2, estimate=False)
    names = ["a low limit 1", "a low limit 2", "a high limit 2", "b high limit"]
    assert list(run.contacts.limit) == names

"""The fastest rates of soft and penalty contacts are those of the linear equations of motion."""

import itertools

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.scene import contact_tables
from pgraph_core.simulation.compliance import fastest_contact


def rate(model, q):
    mech = pg.Mechanism(model)
    tables = contact_tables(mech.packed, model.contacts)
    assert tables is not None
    return fastest_contact(mech, tables, np.array(q, float))


def fastest_eigenvalue(k, c, mass, moments, corners):
    """The largest eigenvalue of a free body on springs k and dampers c at these corners."""
    moves = np.vstack([np.hstack((np.cross(np.eye(3), x), np.eye(3))) for x in corners])
    inverse = np.diag(1.0 / np.array([*moments, mass, mass, mass]))
    held = inverse @ moves.T @ moves
    system = np.block([[np.zeros((6, 6)), np.eye(6)], [-k * held, -c * held]])
    return np.abs(np.linalg.eigvals(system)).max()


@pytest.mark.parametrize("seed", range(20))
def test_a_face_of_a_box_is_as_fast_as_its_fastest_eigenvalue(seed):
    rng = np.random.default_rng(seed)
    size, mass = 10 ** rng.uniform(-2, 1, 3), 10 ** rng.uniform(-2, 2)
    k = mass * 10 ** rng.uniform(2, 7)
    c = rng.choice((0.0, 0.1, 1.0)) * np.sqrt(k * mass)
    box = pg.Body(
        name="box", joint="free", mass=mass, derived=("inertia",),
        shape=pg.Shape(kind="box", size=tuple(size)),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="box", law="penalty", stiffness=k, damping=c)
    found = rate(pg.Model(bodies=[box], contacts=[floor]), (0, 0, size[2] / 2, 1, 0, 0, 0))

    moments = mass / 12 * (np.sum(size**2) - size**2)
    corners = [np.array(x) * size / 2 for x in itertools.product((1, -1), repeat=3)]
    faces = [[x for x in corners if x[i] * side > 0] for i in range(3) for side in (1, -1)]
    true = max(fastest_eigenvalue(k, c, mass, moments, face) for face in faces)
    assert found == pytest.approx(true, rel=1e-6)


@pytest.mark.parametrize("law", ["penalty", "soft"])
def test_a_light_foot_is_faster_than_its_heavy_trunk(law):
    # A foot slides on its trunk: its own mass and armature alone resist, not that of the trunk.
    slide = {"joint": "prismatic", "axes": [(0, 0, 1)]}
    trunk = pg.Body(name="trunk", mass=20.0, **slide)
    ball = pg.Shape(kind="sphere", radius=0.05)
    foot = pg.Body(name="foot", parent="trunk", mass=0.3, armature=(0.1,), shape=ball, **slide)
    floor = pg.Contact(
        name="floor", body="foot", law=law, stiffness=1e5, restitution=1.0, friction=0.0
    )
    found = rate(pg.Model(bodies=[trunk, foot], contacts=[floor]), (1.0, 0.0))
    # The foot recoils from the trunk, which its armature does not move.
    inertia = np.array([[20.3, 0.3], [0.3, 0.4]])
    inverse = np.linalg.inv(inertia).sum()
    weight = 20.3 * 9.81
    slope = 1e5 if law == "penalty" else 1.5 * 1e5 ** (2 / 3) * weight ** (1 / 3)
    assert found == pytest.approx(np.sqrt(slope * inverse), rel=1e-9)


def test_two_boxes_that_touch_add_their_inverse_masses():
    shape = pg.Shape(kind="sphere", radius=0.1)
    balls = [
        pg.Body(
            name=n, joint="free", mass=m, shape=shape, derived=("inertia",), q=(0, 0, z, 1, 0, 0, 0)
        )
        for n, m, z in (("a", 1.0, 1.0), ("b", 3.0, 2.0))
    ]
    touch = pg.Contact(name="touch", body="a", other="b", law="penalty", stiffness=1e4, damping=0.0)
    found = rate(pg.Model(bodies=balls, contacts=[touch]), [*balls[0].q, *balls[1].q])
    # A tangential spring also spins both balls: 1/m + r²/I with I = 2/5 m r².
    assert found == pytest.approx(np.sqrt(1e4 * 3.5 * (1 / 1.0 + 1 / 3.0)), rel=1e-9)


def test_steps_that_a_penalty_contact_of_a_box_needs_are_told_before_they_are_unstable():
    shape = pg.Shape(kind="box", size=(0.4, 0.3, 0.2))
    box = pg.Body(
        name="box", joint="free", mass=2.0, shape=shape, derived=("inertia",),
        q=(0, 0, 0.1, 1, 0, 0, 0),
    )  # fmt: skip
    floor = pg.Contact(name="floor", body="box", law="penalty", stiffness=1e6, damping=0.0)
    model = pg.Model(bodies=[box], contacts=[floor])
    fastest = rate(model, box.q)
    coarse = pg.simulate(model, t_end=0.02, step=1.2 / fastest, estimate=False)
    fine = pg.simulate(model, t_end=0.02, step=0.9 / fastest, estimate=False)
    assert any("do not resolve" in text for text in coarse.notices)
    assert not any("do not resolve" in text for text in fine.notices)
    assert fastest > 3.0 * np.sqrt(1e6 / 2.0)  # four corners, and their rotation

"""Derivatives of forward dynamics against differences at 50 digits, over every kind of joint."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.paper import bodies_of
from tests import fifty_digits
from tests.fifty_digits import exact, mp

from ..nights import at_night
from .trees import random_case, scaled_error, with_joints

H = mp.mpf(10) ** -15  # central differences are then good to 30 digits
CREEP = mp.mpf("1e-3")  # creep speed of joint friction, f v / √(v² + creep²)
HINGES = ("revolute", "prismatic", "cylindrical", "universal", "planar")


def moved(s, j0, h):
    q, i, j = exact(s.q).copy(), 0, 0
    for body in bodies_of(s.model, s.topology):
        for motion in body.sequence:
            nq, nv = joints.SIZE[motion.kind]
            c = j0 - j
            if 0 <= c < nv and nq == nv:
                q[i] += h
            elif 0 <= c < nv and c >= 3:  # the slides of a free motion
                q[i + c - 3] += h
            elif 0 <= c < nv:
                q[i + nq - 4 : i + nq] = turned(q[i + nq - 4 : i + nq], c, h)
            i, j = i + nq, j + nv
    return q


def turned(quaternion, axis, angle):
    w, u = quaternion[0], quaternion[1:]
    c, s = mp.cos(angle / 2), mp.sin(angle / 2)
    h = exact(np.eye(3)[axis])
    return np.array([c * w - s * (h @ u), *(c * u + s * (w * h + np.cross(h, u)))], dtype=object)


def oracle(s, passive=lambda q, v: 0):
    """∂v'/∂q, ∂v'/∂v, ∂v'/∂τ with `passive(q, v)` added to the torques."""

    def acceleration(q, v, tau):
        return fifty_digits.forward_dynamics(s.model, q, v, tau + passive(q, v))

    q, v, tau, n = exact(s.q), exact(s.v), exact(s.tau), len(s.v)
    found = np.zeros((3, n, n))
    for j in range(n):
        step = exact(H * np.eye(n)[j])
        ahead, back = moved(s, j, H), moved(s, j, -H)
        states = (ahead, v, tau), (q, v + step, tau), (q, v, tau + step)
        others = (back, v, tau), (q, v - step, tau), (q, v, tau - step)
        for k, (one, other) in enumerate(zip(states, others)):
            found[k, :, j] = (acceleration(*one) - acceleration(*other)) / (2 * H)
    return found


EVERY_KIND = [(0, 3), (1, 3), (18, 3), (32, 3)]  # of joint


@pytest.mark.parametrize(("seed", "most"), [*EVERY_KIND, *at_night((2, 4), (3, 4), (7, 4))])
def test_derivatives_are_exact_to_rounding(seed, most):
    s = random_case(seed, most=most)
    mech = pg.Mechanism(s.model)
    bound = 1e-13 + 1e-15 * np.linalg.cond(mech.mass_matrix(s.q))
    for found, expected in zip(mech.forward_derivatives(s.q, s.v, s.tau), oracle(s)):
        assert scaled_error(found, expected) < bound


@pytest.mark.parametrize("seed", range(2))
def test_springs_dampers_and_friction_are_in_the_derivatives(seed):
    """Half of the speeds lie within the creep speed, where friction is curved."""
    s = random_case(seed, kinds=HINGES, most=3)
    n, rng = len(s.v), np.random.default_rng(seed)
    s = s._replace(v=s.v * rng.choice([1.0, 1e-3], n))
    stiffness, damping, rest, friction = rng.uniform(0, 9, (4, n))
    fields = {"stiffness": stiffness, "damping": damping, "rest": rest, "friction": friction}
    model = with_joints(s, **fields)

    def passive(q, v):
        rub = np.array([f * x / mp.sqrt(x * x + CREEP**2) for f, x in zip(exact(friction), v)])
        return exact(stiffness) * (exact(rest) - q) - exact(damping) * v - rub

    mech = pg.Mechanism(model)
    bound = 1e-12 + 1e-15 * np.linalg.cond(mech.mass_matrix(s.q))
    for found, expected in zip(mech.forward_derivatives(s.q, s.v, s.tau), oracle(s, passive)):
        assert scaled_error(found, expected) < bound


def test_a_small_mechanism_keeps_its_digits():
    size = 1e-6
    slider = pg.Body(name="a", joint="prismatic", axes=((1, 0, 0),), mass=1e-9)
    inertia = np.eye(3) * 1e-9 * size**2
    rod = pg.Body(name="b", parent="a", com=(size, 0, 0), mass=1e-9, inertia=inertia)
    model = pg.Model(bodies=(slider, rod))
    q, v = np.array([2 * size, 0.3]), np.array([5 * size, 2.0])
    small = {"model": model, "topology": pg.Topology.of(model), "tau": np.array([1e-15, 1e-20])}
    s = random_case(0)._replace(q=q, v=v, **small)
    mech = pg.Mechanism(model)
    for found, expected in zip(mech.forward_derivatives(s.q, s.v, s.tau), oracle(s)):
        for row, right in zip(found, expected):
            assert abs(row - right).max() <= 1e-10 * abs(right).max()


def test_a_long_chain_keeps_its_digits():
    n = 200
    mech, rng = pg.Mechanism(pg.Model.serial(n)), np.random.default_rng(0)
    q, v = rng.normal(size=n), np.zeros(n)
    inverse = mech.forward_derivatives(q, v)[2]
    still = mech.forward_dynamics(q, v)
    for j in (0, 100, n - 1):
        column = mech.forward_dynamics(q, v, 1e6 * np.eye(n)[j]) - still
        assert scaled_error(1e6 * inverse[:, j], column) < 1e-10
    still = pg.Mechanism(pg.Model(bodies=(pg.Body(name="a", joint="weld"),)))
    assert [x.shape for x in still.forward_derivatives(*still.home())] == [(0, 0)] * 3


def test_mechanisms_do_not_share_derivatives():
    first, v = pg.Mechanism(pg.Model.serial(5)), np.ones(5)
    before = first.forward_derivatives(v, v, v)
    heavy, sprung = first.edit("2", mass=50.0), first.edit("2", stiffness=(3.0,))
    for mech in (heavy, sprung):
        fresh = pg.Mechanism(mech.model).forward_derivatives(v, v, v)
        for _ in range(2):  # the workspace is made, then kept
            assert all(map(np.array_equal, mech.forward_derivatives(v, v, v), fresh))
    assert not np.allclose(heavy.forward_derivatives(v, v, v)[2], before[2])
    pull = 3.0 * np.eye(5)[1]
    by_q, by_v, inverse = first.forward_derivatives(v, v, v - pull)
    expected = by_q - np.outer(inverse[:, 1], pull), by_v, inverse
    assert max(map(scaled_error, sprung.forward_derivatives(v, v, v), expected)) < 1e-12
    listed = first.forward_derivatives([1.0] * 5, [1.0] * 5, tau=[1.0] * 5)
    assert all(map(np.array_equal, listed, before))

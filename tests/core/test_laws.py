"""Laws of mechanics that every tree obeys."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import pgraph_core as pg

from .trees import moved, random_case, scaled_error

pytestmark = pytest.mark.quick

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
@settings(max_examples=40)
def test_mass_matrix_is_positive_definite_and_gives_the_kinetic_energy(seed):
    s = random_case(seed)
    mech = pg.Mechanism(s.model)
    M = mech.mass_matrix(s.q)
    assert mech.energy(s.q, s.v)[0] == pytest.approx(s.v @ M @ s.v / 2, rel=1e-12)
    assert scaled_error(M.T, M) < 1e-12
    assert not mech.nv or np.linalg.eigvalsh(M)[0] > 0


@given(seeds)
@settings(max_examples=40)
@example(3755866)  # v' of 1e7: a fixed step is too long
def test_power_of_the_torques_is_the_rate_of_energy(seed):
    """dE/dt = τ·v along the motion, by central differences."""
    s = random_case(seed, most=8)
    mech = pg.Mechanism(s.model)
    vdot = mech.forward_dynamics(s.q, s.v, s.tau)
    h = min(1e-4, 1e-2 / abs(vdot).max(initial=1.0))  # v changes little within it

    def energy(t):
        q = moved(s.model, s.q, t * s.v + t * t / 2 * vdot)
        return sum(mech.energy(q, s.v + t * vdot))

    rates = [(energy(h) - energy(-h)) / (2 * h), (energy(h / 2) - energy(-h / 2)) / h]
    rate = (4 * rates[1] - rates[0]) / 3
    scale = 1 + abs(s.tau @ s.v) + abs(s.v) @ abs(mech.mass_matrix(s.q)) @ abs(vdot)
    assert abs(rate - s.tau @ s.v) < 1e-6 * scale


def test_free_fall_has_the_acceleration_of_gravity_whatever_the_tree():
    """A free tree without velocity falls as one: no joint moves."""
    rng = np.random.default_rng(1)
    s = random_case(1, kinds=("revolute", "prismatic", "spherical"), most=10)
    root = pg.Body(name="root", joint="free", q=(0, 0, 0, 1, 0, 0, 0), link=rng.normal(size=3))
    model = s.model.replace(bodies=(root, *s.model.bodies))
    hung = {b.name: {"parent": "root"} for b in s.model.bodies if b.parent == "ground"}
    mech = pg.Mechanism(model.edit_all(hung))
    vdot = mech.forward_dynamics(np.concatenate((root.q, s.q)), np.zeros(mech.nv))
    np.testing.assert_allclose(vdot[3:6], s.model.gravity, rtol=1e-12)
    assert abs(np.delete(vdot, [3, 4, 5])).max() < 1e-11

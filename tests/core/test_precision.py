"""Forward dynamics against mpmath at 50 digits, where rounding is hardest on it."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.schema.fields import fields_of

from . import fifty_digits
from .trees import random_body, random_state

EPS = float(np.finfo(float).eps)
ALIKE = 1e-13  # relative to the largest acceleration, where all masses are alike
PLANAR = {"axes": (0, 1, 0), "link": (0.2, 0, 0)}


def chain(n, seed=0, masses=None, shape=None, speed=1.0):
    """Hinged bodies one after another, at random in the rest; `masses` scales mass and inertia.

    `shape` (i) gives the fields of body i that are not random.
    """
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(n):
        parent = f"b{i - 1}" if i else "ground"
        body = random_body(rng, f"b{i}", parent, "revolute", armature=False)
        given = shape(i) if shape else {}
        bodies.append(changed(body, 1.0 if masses is None else masses[i], given))
    state = random_state(rng, pg.Model(bodies=tuple(bodies)))
    return state._replace(v=speed * state.v)


def changed(body, factor, given):
    """The body with other fields and, of the same size, of another density."""
    mass, inertia = factor * body.mass, factor * np.array(body.inertia)
    data = {**fields_of(body), "mass": mass, "inertia": inertia}
    if "axes" in given:
        data.pop("motions")
    return pg.Body(**{**data, **given})


def straight(n):
    """A planar chain stretched out: the worst posture for a mass matrix."""
    state = chain(n, shape=lambda i: {**PLANAR, "rotation": (1, 0, 0, 0), "com": (0.1, 0, 0)})
    return state._replace(q=0 * state.q)


def error(state):
    """Largest error of θ'', relative to the largest θ''; the oracle's own is checked."""
    model, _, q, v, tau, *_ = state
    expected = fifty_digits.forward_dynamics(model, q, v, tau)
    again = fifty_digits.inverse_dynamics(model, q, v, expected)
    assert max(abs(again - tau)) < 1e-30
    found = pg.Mechanism(model).forward_dynamics(q, v, tau)
    return float(max(abs(found - expected)) / max(abs(expected)))


def heavy_tip(n):
    return (*np.ones(n - 1), 1e6)


def far(at):
    """Body number `at` (from 0) hangs 1e4 m from its parent."""
    return lambda i: {"link": (1e4, -3e3, 2e3)} if i == at else {}


def at_rest(state):
    return state._replace(v=0 * state.v)


CASES = {  # name: (the state of a seed, bound); measured: the worst of five seeds
    "10 at random": (lambda seed: chain(10, seed), ALIKE),  # 4e-15
    "100 at random": (lambda seed: chain(100, seed), ALIKE),  # 1e-14
    "10, speeds x 100": (lambda seed: chain(10, seed, speed=100), ALIKE),  # 2e-15
    "100, speeds x 100": (lambda seed: chain(100, seed, speed=100), ALIKE),  # 5e-14
    # Dense algebra and MuJoCo are at 4e-12 with chains of 100.
    "100 at rest": (lambda seed: at_rest(chain(100, seed)), ALIKE),  # 6e-15
    "straight planar 10": (lambda seed: straight(10), ALIKE),  # 3e-16
    "straight planar 100": (lambda seed: straight(100), ALIKE),  # 3e-16
    "10, tip mass x 1e6": (lambda seed: chain(10, seed, heavy_tip(10)), 10 * EPS * 1e6),  # 2e-10
    "100, tip mass x 1e6": (lambda seed: chain(100, seed, heavy_tip(100)), 10 * EPS * 1e6),  # 6e-11
    "10, masses to 1e-8": (lambda seed: chain(10, seed, np.geomspace(1, 1e-8, 10)), ALIKE),  # 1e-14
    "100, masses to 1e-8": (
        lambda seed: chain(100, seed, np.geomspace(1, 1e-8, 100)),
        ALIKE,
    ),  # 5e-13
    "root 1e4 m away": (lambda seed: chain(10, seed, shape=far(0)), ALIKE),  # 4e-15
    "chain on an arm of 1e4 m": (lambda seed: chain(10, seed, shape=far(1)), ALIKE),  # 2e-15
    # Six bodies bear the moment of an arm of 1e4 m: inertias in the ratio 1e8, as masses would be.
    "arm of 1e4 m inside": (lambda seed: chain(10, seed, shape=far(5)), 10 * EPS * 1e8),  # 2e-8
}
# Packing makes the home rotations orthonormal body by body: without it their product along 1000
# random bodies leaves the axes 3e-14 off unit length, and Rodrigues' formula adds that up to 8e-12.
THOUSANDS = {
    "1000 at random": (lambda seed: chain(1000, seed), ALIKE),  # 5e-15
    "1000 at rest": (lambda seed: at_rest(chain(1000, seed)), ALIKE),  # 4e-14
    "straight planar 1000": (lambda seed: straight(1000), ALIKE),  # 1e-15
}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("name", CASES)
def test_forward_dynamics_to_fifty_digits(name, seed):
    """1e-13, or 10 eps x mass ratio where that is larger; else what was measured, with why."""
    state, bound = CASES[name]
    assert error(state(seed)) < bound


@pytest.mark.nightly
@pytest.mark.parametrize("name", THOUSANDS)
def test_forward_dynamics_of_a_thousand_bodies_to_fifty_digits(name):
    state, bound = THOUSANDS[name]
    assert error(state(0)) < bound

"""Chains on which rounding is hard: the cases of test_precision and of docs/precision.md."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core.model.fields import fields_of
from pgraph_core.rotation import matrix, multiply

from .random_models import State, random_body, random_quaternion, random_state

EPS = float(np.finfo(float).eps)
ALIKE = 1e-13  # relative to the largest acceleration, where all masses are alike
HEAVY = 10 * EPS * 1e6  # a tip mass of 1e6
# Six bodies bear the moment of an arm of 1e4 m: inertias in the ratio 1e8, as masses would be.
MOMENT = 10 * EPS * 1e8
PLANAR = {"axes": (0, 1, 0), "link": (0.2, 0, 0)}


class Case(NamedTuple):
    """A state for every seed, and the bound of the largest error relative to the largest θ''."""

    state: Callable[[int], State]
    bound: float
    skew: float = 0.0  # the bound where all frames are turned, if another one

    @property
    def turned_bound(self) -> float:
        return self.skew or self.bound


def bending(n):
    """Bound of a straight chain of n rods in frames that do not lie along it.

    Out of its plane it is n³/3 times as heavy to bend as one rod in it; turned axes mix the two,
    and rounding is then that of masses in this ratio. (Drake and Pinocchio lose as much there.)
    """
    return 10 * EPS * n**3 / 3


def chain(n, seed=0, masses=None, shape=None, speed=1.0) -> State:
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


def changed(body, factor, given) -> pg.Body:
    """The body with other fields and, of the same size, of another density."""
    mass, inertia = factor * body.mass, factor * np.array(body.inertia)
    data = {**fields_of(body), "mass": mass, "inertia": inertia}
    if "axes" in given:
        data.pop("motions")
    return pg.Body(**{**data, **given})


def straight(n, seed=0) -> State:
    """A planar chain stretched out: the worst posture for a mass matrix."""
    fields = {**PLANAR, "rotation": (1, 0, 0, 0), "com": (0.1, 0, 0)}
    state = chain(n, seed, shape=lambda i: fields)
    return state._replace(q=0 * state.q)


def heavy_tip(n):
    return (*np.ones(n - 1), 1e6)


def taper(n):
    return np.geomspace(1, 1e-8, n)


def far(at):
    """Body number `at` (from 0) hangs 1e4 m from its parent."""
    return lambda i: {"link": (1e4, -3e3, 2e3)} if i == at else {}


def at_rest(state: State) -> State:
    return state._replace(v=0 * state.v)


def turned(state: State, seed: int = 0) -> State:
    """The same chain as a whole in another orientation, and every body frame turned at random.

    No frame lies along a rod or the world any more: what luck of the axes hides comes out.
    """
    rng = np.random.default_rng(seed)
    turn = {"ground": random_quaternion(rng)}
    bodies = []
    for body in state.model.bodies:
        turn[body.name] = random_quaternion(rng)
        base, own = matrix(turn[body.parent]).T, matrix(turn[body.name]).T
        w, *u = turn[body.parent]
        inertia = own @ np.array(body.inertia) @ own.T
        bodies.append(
            pg.Body(
                name=body.name,
                parent=body.parent,
                mass=body.mass,
                axes=tuple(own @ body.axes[0]),
                link=tuple(base @ body.link),
                com=tuple(own @ body.com),
                inertia=(inertia + inertia.T) / 2,
                rotation=multiply(
                    multiply((w, -u[0], -u[1], -u[2]), body.rotation), turn[body.name]
                ),
            )
        )
    gravity = tuple(matrix(turn["ground"]).T @ state.model.gravity)
    return state._replace(model=pg.Model(bodies=tuple(bodies), gravity=gravity))


SHORT: Mapping[str, Case] = {  # measured: the worst of five seeds
    "10 at random": Case(lambda seed: chain(10, seed), ALIKE),  # 4e-15
    "100 at random": Case(lambda seed: chain(100, seed), ALIKE),  # 1e-14
    "10, speeds x 100": Case(lambda seed: chain(10, seed, speed=100), ALIKE),  # 2e-15
    "100, speeds x 100": Case(lambda seed: chain(100, seed, speed=100), ALIKE),  # 5e-14
    # Dense algebra and MuJoCo are at 4e-12 with chains of 100.
    "100 at rest": Case(lambda seed: at_rest(chain(100, seed)), ALIKE),  # 6e-15
    "straight planar 10": Case(lambda seed: straight(10, seed), ALIKE, bending(10)),  # 3e-16
    "straight planar 100": Case(lambda seed: straight(100, seed), ALIKE, bending(100)),  # 3e-16
    "10, tip mass x 1e6": Case(lambda seed: chain(10, seed, heavy_tip(10)), HEAVY),  # 2e-10
    "100, tip mass x 1e6": Case(lambda seed: chain(100, seed, heavy_tip(100)), HEAVY),  # 6e-11
    "10, masses to 1e-8": Case(lambda seed: chain(10, seed, taper(10)), ALIKE),  # 1e-14
    "100, masses to 1e-8": Case(lambda seed: chain(100, seed, taper(100)), ALIKE),  # 5e-13
    "root 1e4 m away": Case(lambda seed: chain(10, seed, shape=far(0)), ALIKE),  # 4e-15
    "chain on an arm of 1e4 m": Case(lambda seed: chain(10, seed, shape=far(1)), ALIKE),  # 2e-15
    "arm of 1e4 m inside": Case(lambda seed: chain(10, seed, shape=far(5)), MOMENT),  # 2e-8
}
# Packing makes the home rotations orthonormal body by body: without it their product along 1000
# random bodies leaves the axes 3e-14 off unit length, and Rodrigues' formula adds that up to 8e-12.
LONG: Mapping[str, Case] = {
    "1000 at random": Case(lambda seed: chain(1000, seed), ALIKE),  # 5e-15
    "1000 at rest": Case(lambda seed: at_rest(chain(1000, seed)), ALIKE),  # 4e-14
    "straight planar 1000": Case(lambda seed: straight(1000, seed), ALIKE, bending(1000)),  # 1e-15
}

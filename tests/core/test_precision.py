"""Forward dynamics against mpmath at 50 digits, where rounding is hardest on it."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.fields import fields_of
from pgraph_core.rotation import matrix, multiply
from tests import fifty_digits
from tests.random_models import State, random_body, random_quaternion, random_state

EPS = float(np.finfo(float).eps)
ALIKE = 1e-13  # relative to the largest acceleration, where all masses are alike
HEAVY = 10 * EPS * 1e6  # a tip mass of 1e6
MOMENT = 10 * EPS * 1e8  # six bodies bear the moment of an arm of 1e4 m: inertias in the ratio 1e8
PLANAR = {"axes": (0, 1, 0), "link": (0.2, 0, 0), "rotation": (1, 0, 0, 0), "com": (0.1, 0, 0)}


def bending(n):
    """Bound of a straight chain of n rods in frames that do not lie along it.

    Out of its plane it is n³/3 times as heavy to bend as one rod in it; turned axes mix the two,
    and rounding is then that of masses in this ratio. (Drake and Pinocchio lose as much there.)
    """
    return 10 * EPS * n**3 / 3


def chain(n, seed, masses=None, shape=None, speed=1.0) -> State:
    """Hinged bodies in a row, at random but for `masses` and the fields by `shape` of a number."""
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(n):
        body = random_body(rng, f"b{i}", f"b{i - 1}" if i else "ground", "revolute", False)
        factor, given = 1.0 if masses is None else masses[i], shape(i) if shape else {}
        fields = fields_of(body)
        if "axes" in given:
            fields.pop("motions")
        mass, inertia = factor * body.mass, factor * np.array(body.inertia)
        bodies.append(pg.Body(**{**fields, "mass": mass, "inertia": inertia, **given}))
    state = random_state(rng, pg.Model(bodies=tuple(bodies)))
    return state._replace(v=speed * state.v)


def straight(n, seed) -> State:
    state = chain(n, seed, shape=lambda i: PLANAR)
    return state._replace(q=0 * state.q)


def far(at):
    return lambda i: {"link": (1e4, -3e3, 2e3)} if i == at else {}


def turned(state: State) -> State:
    """The same chain with every frame turned at random, so that no luck of the axes helps."""
    rng = np.random.default_rng(1)
    turn = {"ground": random_quaternion(rng)}
    bodies = []
    for body in state.model.bodies:
        turn[body.name] = random_quaternion(rng)
        base, own = matrix(turn[body.parent]).T, matrix(turn[body.name]).T
        w, *u = turn[body.parent]
        inertia = own @ np.array(body.inertia) @ own.T
        home = multiply(multiply((w, -u[0], -u[1], -u[2]), body.rotation), turn[body.name])
        bodies.append(
            pg.Body(
                name=body.name, parent=body.parent, mass=body.mass, axes=tuple(own @ body.axes[0]),
                link=tuple(base @ body.link), com=tuple(own @ body.com),
                inertia=(inertia + inertia.T) / 2, rotation=home,
            )
        )  # fmt: skip
    gravity = tuple(matrix(turn["ground"]).T @ state.model.gravity)
    return state._replace(model=pg.Model(bodies=tuple(bodies), gravity=gravity))


def cases(n):
    """Chains of n bodies: state by seed, bound of the relative error, bound of turned frames."""
    tip, taper = (*np.ones(n - 1), 1e6), np.geomspace(1, 1e-8, n)
    return {
        f"{n} at random": (lambda seed: chain(n, seed), ALIKE),
        f"{n} at rest": (lambda seed: chain(n, seed, speed=0.0), ALIKE),
        f"straight planar {n}": (lambda seed: straight(n, seed), ALIKE, bending(n)),
        f"{n}, speeds x 100": (lambda seed: chain(n, seed, speed=100), ALIKE),
        f"{n}, tip mass x 1e6": (lambda seed: chain(n, seed, tip), HEAVY),
        f"{n}, masses to 1e-8": (lambda seed: chain(n, seed, taper), ALIKE),
    }


SHORT = cases(10) | {
    "100 at random": (lambda seed: chain(100, seed), ALIKE),
    "root 1e4 m away": (lambda seed: chain(10, seed, shape=far(0)), ALIKE),
    "chain on an arm of 1e4 m": (lambda seed: chain(10, seed, shape=far(1)), ALIKE),
    "arm of 1e4 m inside": (lambda seed: chain(10, seed, shape=far(5)), MOMENT),
}
THOUSAND = ("1000 at random", "1000 at rest", "straight planar 1000")
LONG = cases(100) | {name: cases(1000)[name] for name in THOUSAND}
NIGHTLY = [pytest.param(name, marks=pytest.mark.nightly) for name in LONG if name not in SHORT]


def error(state):
    """Return the largest error of θ'' relative to the largest θ'', checking the oracle's own."""
    model, _, q, v, tau, *_ = state
    expected = fifty_digits.forward_dynamics(model, q, v, tau)
    again = fifty_digits.inverse_dynamics(model, q, v, expected)
    assert max(abs(again - tau)) < 1e-30
    found = pg.Mechanism(model).forward_dynamics(q, v, tau)
    return float(max(abs(found - expected)) / max(abs(expected)))


@pytest.mark.parametrize("name", [*SHORT, *NIGHTLY])
def test_forward_dynamics_to_fifty_digits(name):
    """The bound is 1e-13, or 10 eps x mass ratio if larger, also with all frames turned."""
    state, *bounds = (LONG | SHORT)[name]
    assert error(state(1)) < bounds[0]
    assert error(turned(state(0))) < bounds[-1]

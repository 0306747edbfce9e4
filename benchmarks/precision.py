"""Errors of accelerations of long chains against 50 digits, ours and the peers'.

Each number is relative to the largest acceleration, the worst of three random chains. In turned
frames the whole chain and every body frame are rotated at random, so that no program gains from
axes that lie along a rod.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import matrix, multiply, unit
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

from .machine import has
from .measure import Effort, Row
from .scenes import STEP, Scene, State, random_state

MINUTES = 2.0
PEERS = ("mujoco", "pin", "drake")
NEEDS = ("mpmath",)
SEEDS = 3
CUBIC = 300  # bodies: beyond, Pinocchio's data on a chain does not fit into memory


def rows(effort: Effort) -> Iterator[Row]:
    cases = effort.pick(CASES, {"10 at random": CASES["10 at random"]})
    for name, make in cases.items():
        seeds = 1 if name.startswith("1000") or effort.quick else SEEDS
        states = [make(np.random.default_rng(seed)) for seed in range(seeds)]
        for frames in ("turned", "original"):
            found = [
                errors(turned(s, k) if frames == "turned" else s) for k, s in enumerate(states)
            ]
            worst = {by: max(error[by] for error in found) for by in found[0]}
            yield {"case": name, "frames": frames, **dict.fromkeys(("pgraph", *PEERS)), **worst}


def errors(state: State) -> dict[str, float]:
    """Largest error relative to the largest acceleration, by engine."""
    expected = in_fifty_digits(state.model, state.q, state.v, state.tau)
    scale = max(abs(expected))
    return {by: float(max(abs(found - expected)) / scale) for by, found in accelerations(state)}


def accelerations(state: State) -> Iterator[tuple[str, np.ndarray]]:
    """v' by every installed engine, in our coordinates."""
    place = Scene("", state, rows_of(state.model, state.topology))
    yield "pgraph", pg.Mechanism(state.model).forward_dynamics(state.q, state.v, state.tau)
    if has("mujoco"):
        import mujoco

        model, data, T = in_mujoco.loaded(place, STEP)
        mujoco.mj_forward(model, data)
        yield "mujoco", T.T @ data.qacc
    if has("pin") and state.topology.nb <= CUBIC:
        yield "pin", in_pinocchio.forward_dynamics(place)[1]
    if has("drake"):
        yield "drake", in_drake.forward_dynamics(place)[1]


# -- the chains ------------------------------------------------------------------------------------


def chain(
    rng: np.random.Generator, n: int, masses: Any = None, speed: float = 1.0, **fields: Any
) -> State:
    """Hinged bodies one after another, at random but for the given fields.

    `masses` scales mass and inertia; `far` is the number of a body that hangs 1e4 m away.
    """
    bodies, far = [], fields.pop("far", -1)
    for i in range(n):
        points = rng.normal(size=(6, 3)) * rng.uniform(0.1, 0.5, 3)
        spread = np.cov(points.T, bias=True)
        mass = float(rng.uniform(0.5, 3)) * (1.0 if masses is None else masses[i])
        given: dict[str, Any] = {
            "axes": tuple(rng.normal(size=3)), "link": tuple(rng.normal(0, 0.5, 3)),
            "rotation": tuple(unit(rng.normal(size=4))), "com": tuple(rng.normal(0, 0.2, 3)),
            "inertia": mass * (np.trace(spread) * np.eye(3) - spread), **fields,
        }  # fmt: skip
        if i == far:
            given["link"] = (1e4, -3e3, 2e3)
        bodies.append(
            pg.Body(name=f"b{i}", parent=f"b{i - 1}" if i else "ground", mass=mass, **given)
        )
    state = random_state(rng, pg.Model(bodies=tuple(bodies), gravity=tuple(rng.normal(0, 6, 3))))
    return state._replace(v=speed * state.v)


def straight(rng: np.random.Generator, n: int) -> State:
    """A planar chain stretched out: the worst posture for a mass matrix."""
    flat = {"axes": (0, 1, 0), "link": (0.2, 0, 0), "rotation": (1, 0, 0, 0), "com": (0.1, 0, 0)}
    state = chain(rng, n, **flat)
    return state._replace(q=0 * state.q)


CASES: dict[str, Callable[[np.random.Generator], State]] = {
    "10 at random": lambda rng: chain(rng, 10),
    "100 at random": lambda rng: chain(rng, 100),
    "10, speeds x 100": lambda rng: chain(rng, 10, speed=100),
    "100, speeds x 100": lambda rng: chain(rng, 100, speed=100),
    "100 at rest": lambda rng: chain(rng, 100, speed=0),
    "straight planar 10": lambda rng: straight(rng, 10),
    "straight planar 100": lambda rng: straight(rng, 100),
    "10, tip mass x 1e6": lambda rng: chain(rng, 10, (*np.ones(9), 1e6)),
    "100, tip mass x 1e6": lambda rng: chain(rng, 100, (*np.ones(99), 1e6)),
    "10, masses to 1e-8": lambda rng: chain(rng, 10, np.geomspace(1, 1e-8, 10)),
    "100, masses to 1e-8": lambda rng: chain(rng, 100, np.geomspace(1, 1e-8, 100)),
    "root 1e4 m away": lambda rng: chain(rng, 10, far=0),
    "chain on an arm of 1e4 m": lambda rng: chain(rng, 10, far=1),
    "arm of 1e4 m inside": lambda rng: chain(rng, 10, far=5),
    "1000 at random": lambda rng: chain(rng, 1000),
    "1000 at rest": lambda rng: chain(rng, 1000, speed=0),
    "straight planar 1000": lambda rng: straight(rng, 1000),
}


def turned(state: State, seed: int) -> State:
    """The same chain as a whole in another orientation, and every body frame turned at random."""
    rng = np.random.default_rng(seed)
    turn = {"ground": unit(rng.normal(size=4))}
    bodies = []
    for body in state.model.bodies:
        turn[body.name] = unit(rng.normal(size=4))
        base, own = matrix(turn[body.parent]).T, matrix(turn[body.name]).T
        w, *u = turn[body.parent]
        back = (w, -u[0], -u[1], -u[2])
        inertia = own @ np.array(body.inertia) @ own.T
        bodies.append(
            pg.Body(
                name=body.name, parent=body.parent, mass=body.mass,
                axes=tuple(own @ body.axes[0]), link=tuple(base @ body.link),
                com=tuple(own @ body.com), inertia=(inertia + inertia.T) / 2,
                rotation=multiply(multiply(back, body.rotation), turn[body.name]),
            )
        )  # fmt: skip
    gravity = tuple(matrix(turn["ground"]).T @ state.model.gravity)
    return state._replace(model=pg.Model(bodies=tuple(bodies), gravity=gravity))


# -- 50 digits -------------------------------------------------------------------------------------


def in_fifty_digits(model: pg.Model, q: Any, v: Any, tau: Any) -> np.ndarray:
    """v' of a chain of hinges by mpmath, by articulated bodies.

    All spatial vectors are taken at the world's origin, so nothing is shared with the kernels. The
    digits that a body far away costs are there to spend.
    """
    import mpmath

    mp = mpmath.mp.clone()
    mp.dps = 50

    def exact(x: Any) -> np.ndarray:
        return np.vectorize(mp.mpf, otypes=[object])(np.asarray(x, dtype=float))

    def skew(x: Any) -> np.ndarray:
        return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]], dtype=object)

    def across(V: np.ndarray) -> np.ndarray:
        w, u = skew(V[:3]), skew(V[3:])
        return np.block([[w, np.zeros((3, 3), object)], [u, w]])

    one = np.eye(3, dtype=object)
    q, v, tau = exact(q), exact(v), exact(tau)
    R, p, V = one, exact(np.zeros(3)), exact(np.zeros(6))
    S, c, inertia, force = [], [], [], []
    for i, body in enumerate(model.bodies):
        w, *u = exact(body.rotation) / mp.sqrt(sum(exact(body.rotation) ** 2))
        k = skew(u)
        home = one + 2 * w * k + 2 * k @ k
        p = p + R @ exact(body.link)
        h = home @ exact(body.axes[0])
        h = h / mp.sqrt(sum(h * h))
        h, k = R @ h, skew(h)
        R = R @ (one + mp.sin(q[i]) * k + (1 - mp.cos(q[i])) * (k @ k)) @ home
        S.append(np.concatenate((h, skew(p) @ h)))
        c.append(across(V) @ S[i] * v[i])
        V = V + S[i] * v[i]
        m, com = mp.mpf(body.mass), skew(p + R @ exact(body.com))
        central = R @ exact(body.inertia) @ R.T
        inertia.append(np.block([[central - m * com @ com, m * com], [-m * com, m * one]]))
        force.append(-across(V).T @ (inertia[i] @ V))
    U, D, u = [None] * len(S), [None] * len(S), [None] * len(S)
    for i in range(len(S) - 1, -1, -1):
        U[i] = inertia[i] @ S[i]
        D[i], u[i] = S[i] @ U[i], tau[i] - S[i] @ force[i]
        if i:
            left = inertia[i] - np.outer(U[i], U[i]) / D[i]
            inertia[i - 1] = inertia[i - 1] + left
            force[i - 1] = force[i - 1] + force[i] + left @ c[i] + U[i] * (u[i] / D[i])
    A, vdot = np.concatenate((exact(np.zeros(3)), -exact(model.gravity))), []
    for i in range(len(S)):
        A = A + c[i]
        vdot.append((u[i] - U[i] @ A) / D[i])
        A = A + S[i] * vdot[i]
    return np.array(vdot)

"""The quadruped's stance without Pgraph: Pinocchio's proximal solver inside a plain RK4.

The servos come from the description, the quaternion's rate is written out, no position or velocity
is projected. `tests/golden/build.py` writes it as a golden file.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import pgraph_core as pg
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

from .random_models import State

SETTINGS = (1e-13, 1e-9, 50)  # of Pinocchio's solver: accuracy, mu, iterations
SCENARIO, FRAMES = "stance", 6  # Fig. 10: a picture every 50 ms


def stance(model: pg.Model) -> dict[str, np.ndarray]:
    """t, q, v and the feet's forces (frames, 4, 3) on the paws, in the order of constraints."""
    scenario = model.scenario(SCENARIO)
    acceleration = constrained(model, scenario)
    topology = pg.Topology.of(model)
    y = np.concatenate([model.body(name).q for name in topology.names])
    q, v = y, np.zeros(21)
    steps = round(scenario.t_end / scenario.step)
    h, keep = scenario.t_end / steps, steps // (FRAMES - 1)
    times, found = [], []
    for n in range(steps + 1):
        if n % keep == 0:
            times.append(n * h)
            found.append((q, v, acceleration(n * h, q, v)[1]))
        q, v = rk4(acceleration, n * h, h, q, v)
    qs, vs, forces = (np.array(column) for column in zip(*found))
    return {"t": np.array(times), "q": qs, "v": vs, "force": forces}


def rk4(acceleration: Callable, t: float, h: float, q: np.ndarray, v: np.ndarray) -> tuple:
    """One step of the classical method on q, quaternion included, and v."""

    def rate(s: float, q: np.ndarray, v: np.ndarray) -> tuple:
        return velocity(q, v), acceleration(t + s, q, v)[0]

    k1 = rate(0, q, v)
    k2 = rate(h / 2, q + h / 2 * k1[0], v + h / 2 * k1[1])
    k3 = rate(h / 2, q + h / 2 * k2[0], v + h / 2 * k2[1])
    k4 = rate(h, q + h * k3[0], v + h * k3[1])
    q, v = (x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v), k1, k2, k3, k4))
    q[3:7] /= np.linalg.norm(q[3:7])
    return q, v


def velocity(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """q' of a free root and hinges: ½ [0, ω] times the quaternion."""
    w, x = q[3], q[4:7]
    turn = np.concatenate(([-v[:3] @ x], w * v[:3] + np.cross(v[:3], x))) / 2
    return np.concatenate((v[3:6], turn, v[6:]))


def constrained(model: pg.Model, scenario: pg.Scenario) -> Callable:
    """(t, q, v) -> (v', forces (4, 3)) with the scenario's servos, by pin.constraintDynamics."""
    state = at_home(model)
    rows = rows_of(model, state.topology)
    acceleration, forces = in_pinocchio.constrained(state, SETTINGS)
    servo = [(state.topology.names.index(f.body) + 5, f) for f in scenario.forces]

    def rate(t: float, q: np.ndarray, v: np.ndarray) -> tuple:
        unit = np.concatenate((q[:3], q[3:7] / np.linalg.norm(q[3:7]), q[7:]))
        tau = np.zeros(21)
        for j, f in servo:
            tau[j] = f.kp * (value(f.target, t) - q[j + 1]) - f.kd * v[j] + value(f.torque, t)
        p, T, Tdot_v = in_pinocchio.coordinates(rows, unit, v)
        a = acceleration(p, T @ v, np.linalg.solve(T.T, tau))
        return np.linalg.solve(T, a - Tdot_v), forces()

    return rate


def at_home(model: pg.Model) -> State:
    """The model's own initial state, without torques."""
    topology = pg.Topology.of(model)
    q = np.concatenate([model.body(name).q for name in topology.names])
    v = np.concatenate([model.body(name).v for name in topology.names])
    return State(model, topology, q, v, 0 * v, v, np.zeros((0, 6)))


def value(table: float | pg.Table, t: float) -> float:
    """A constant, or straight lines between knots."""
    return table if isinstance(table, float) else float(np.interp(t, table.t, table.value))

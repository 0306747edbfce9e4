"""Models and states that several benchmarks use."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_core.paper import bodies_of
from pgraph_core.rotation import unit
from pgraph_peers.rows import Scene as Scene
from pgraph_peers.rows import rows_of

STEP = 1e-3  # s


class State(NamedTuple):
    """A model with a state and forces, all in number order."""

    model: pg.Model
    topology: pg.Topology
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    vdot: np.ndarray
    external: np.ndarray  # (nb, 6) on the bodies at their origins, world axes


def random_state(rng: np.random.Generator, model: pg.Model) -> State:
    """Random q with unit quaternions, v and tau."""
    topology = pg.Topology.of(model)
    q: list[float] = []
    for body in bodies_of(model, topology):
        for motion in body.sequence:
            if motion.kind == "free":
                q += list(rng.normal(0, 0.5, 3))
            if motion.kind in ("ball", "free"):
                q += list(unit(rng.normal(size=4)))
            else:
                q.append(rng.uniform(-2, 2))
    v, tau, vdot = rng.normal(size=(3, int(topology.dof.sum()))) * np.array([[1.5], [5.0], [3.0]])
    return State(model, topology, np.array(q), v, tau, vdot, np.zeros((topology.nb, 6)))


def scene(name: str, model: pg.Model, speed: float = 1.0, seed: int = 3) -> Scene:
    """A random state of a model; `speed` scales its velocities."""
    state = random_state(np.random.default_rng(seed), model)
    return Scene(name, state._replace(v=speed * state.v), rows_of(model, state.topology))


def built_in(name: str) -> pg.Model:
    """A built-in model."""
    return pg.Model.load(pgraph_models.path(name))


def tree_of_quadruped(speed: float = 1.0) -> Scene:
    """The quadruped without its feet on the ground."""
    model = built_in("quadruped").replace(scenarios=(), constraints=(), forces=())
    return scene("quadruped", model, speed)


def standing() -> State:
    """The quadruped at rest under the torques of the scenario 'stand'."""
    model = built_in("quadruped")
    mech = pg.Mechanism(model)
    q, v = mech.home()
    tau = np.zeros(mech.nv)
    for force in model.scenario("stand").forces:
        tau[mech.names.index(force.body) + 5] = force.torque
    return State(model, mech.topology, q, v, tau, v, np.zeros((mech.nb, 6)))


def binary_tree(n: int) -> pg.Model:
    """Rods in a tree with two children each."""
    rods = pg.Model.serial(n).bodies
    parents = ["ground", *(str(i // 2) for i in range(2, n + 1))]
    return pg.Model(bodies=tuple(b.model_copy(update={"parent": p}) for b, p in zip(rods, parents)))

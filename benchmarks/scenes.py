"""The models that everything is measured on, and states for them."""

from __future__ import annotations

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_peers.rows import Scene as Scene
from pgraph_peers.rows import rows_of

from .random_models import random_state

STEP = 1e-3  # s


def scene(name: str, model: pg.Model, speed: float = 1.0, seed: int = 3) -> Scene:
    """A random state of a model; `speed` scales its velocities."""
    state = random_state(np.random.default_rng(seed), model)
    return Scene(name, state._replace(v=speed * state.v), rows_of(model, state.topology))


def quadruped() -> pg.Model:
    """The built-in one, with its constraints and scenarios."""
    return pg.Model.load(pgraph_models.path("quadruped"))


def bare(model: pg.Model) -> pg.Model:
    """A model without constraints, forces and scenarios."""
    return model.replace(scenarios=(), constraints=(), forces=())


def binary_tree(n: int) -> pg.Model:
    """Rods in a tree with two children each."""
    rods = pg.Model.serial(n).bodies
    parents = ["ground", *(str(i // 2) for i in range(2, n + 1))]
    return pg.Model(bodies=tuple(b.model_copy(update={"parent": p}) for b, p in zip(rods, parents)))


def differ(found: np.ndarray, expected: np.ndarray, bound: float, what: str) -> str:
    """The relative difference of two results. Exits if it is not below the bound."""
    error = float(abs(found - expected).max() / max(1.0, abs(expected).max()))
    if not error < bound:
        raise SystemExit(f"{what}: the results differ by {error:.2e}; nothing is timed")
    return f"{error:.0e}"

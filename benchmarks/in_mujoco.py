"""A scene in MuJoCo: what is timed, on `pgraph_core.peers.in_mujoco`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

import pgraph_core as pg
from pgraph_core.peers import in_mujoco as peer
from pgraph_core.peers.elementary import rows_of
from tests.core.trees import State
from tests.golden import with_mujoco

from .scenes import STEP, Scene

STIFF_ANCHOR = (
    'solref="0.0005 1" solimp="0.9999 0.9999 0.001"'  # what its RK4 at 0.2 ms still takes
)
ANCHOR = 'solref="0.002 1" solimp="0.99 0.999 0.001"'  # MuJoCo's feet are soft: near its stiffest


def spec_builder(scene: Scene, method: str = "semi_implicit_euler") -> Callable[[], Any]:
    """A function that builds the spec from numbers that are at hand."""
    return peer.spec_builder(scene.rows, scene.model.gravity, STEP, method)


def loaded(scene: Scene, method: str = "semi_implicit_euler") -> tuple[Any, Any, np.ndarray]:
    """(model, data in the scene's state, T with qvel = T v)."""
    model = spec_builder(scene, method)().compile()
    data = mujoco.MjData(model)
    data.qpos[:], T = peer.coordinates(scene.rows, scene.state.q, scene.state.v)
    data.qvel[:] = T @ scene.state.v
    data.qfrc_applied[:] = T @ scene.state.tau
    return model, data, T


def rollout(scene: Scene, method: str, n: int, count: int = 1, threads: int = 0) -> Any:
    """A function that takes n steps of `count` instances, and MuJoCo's change of qpos in it."""
    model, data, T = loaded(scene, method)
    data.qfrc_applied[:] = 0.0
    start = np.concatenate(([0.0], data.qpos, data.qvel))
    starts = np.repeat(start[None], count, axis=0)
    pool = mujoco.rollout.Rollout(nthread=threads if threads > 1 else 0)
    each = [mujoco.MjData(model) for _ in range(max(threads, 1))]
    out = np.empty((count, n, len(start)))

    def run() -> np.ndarray:
        pool.rollout(model, each, starts, nstep=n, state=out, skip_checks=False)
        return out

    return run, lambda: run()[:, -1, 1 : 1 + model.nq] - data.qpos


def stance(state: State, anchor: str = ANCHOR, option: str = "") -> tuple[Any, Any]:
    """(model, data) with four `connect` constraints."""
    rows = rows_of(state.model, state.topology)
    feet = "".join(
        f'<connect body1="{c.body}" body2="world" anchor="{" ".join(map(str, c.point))}" {anchor}/>'
        for c in state.model.constraints
    )
    flag, extra = 'contact="disable"', f"<equality>{feet}</equality>"
    model = mujoco.MjModel.from_xml_string(with_mujoco.mjcf(state.model, rows, option, flag, extra))
    data = mujoco.MjData(model)
    data.qpos[:], T = peer.coordinates(rows, state.q, state.v)
    data.qfrc_applied[:] = T @ state.tau
    return model, data


def held(model: pg.Model, step: float) -> tuple[Any, Any]:
    """(model, data) of a stance at home to be integrated by RK4, the feet as stiff as can be."""
    topology = pg.Topology.of(model)
    q = np.concatenate([model.body(name).q for name in topology.names])
    v = np.concatenate([model.body(name).v for name in topology.names])
    state = State(model, topology, q, v, 0 * v, v, np.zeros((0, 6)))
    option = f'timestep="{step}" integrator="RK4" tolerance="0" iterations="20"'
    return stance(state, STIFF_ANCHOR, option)

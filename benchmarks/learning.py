"""Environments for learning against Gymnasium's MuJoCo Ant: random actions, resets, rewards.

An action of ours is 20 steps of 1 ms, one of the Ant's 5 steps of 10 ms by RK4. Gymnasium steps its
Ants one after the other in Python; two threads of ours work, so processor time is compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from .machine import has
from .measure import Effort, Row, compared

MINUTES = 1.0
PEERS = ("mujoco",)
NEEDS = ("gymnasium",)
ANT = "Ant-v5"
SECONDS = {ANT: 0.05}  # simulated by an action; ours: 0.02


def rows(effort: Effort) -> Iterator[Row]:
    import gymnasium

    import pgraph_core.gym

    size, ants = effort.pick((512, 16), (4, 1))
    envs: dict[str, Any] = {
        name: gymnasium.make_vec(name, num_envs=size, threads=2)
        for name in list(pgraph_core.gym.ENVIRONMENTS)[: effort.pick(None, 1)]
    }
    if has("mujoco"):
        envs[ANT] = gymnasium.make_vec(ANT, num_envs=ants, vectorization_mode="sync")
    for env in envs.values():
        env.reset(seed=0)
        env.action_space.seed(0)
    sides, found = {name: partial(act, env) for name, env in envs.items()}, {}
    for row in compared(effort, "actions", sides, unit="call", rounds=effort.pick(9, 2)):
        found[row["by"]] = row["seconds"] / envs[row["by"]].num_envs
    for name, seconds in found.items():
        yield {
            "case": name,
            "actions per processor second": round(1 / seconds),
            "simulated s per processor s": round(SECONDS.get(name, 0.02) / seconds),
        }
    for env in envs.values():
        env.close()


def act(env: Any) -> None:
    """A random action of every instance."""
    env.step(env.action_space.sample())

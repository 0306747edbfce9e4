"""Environments for learning next to Gymnasium's MuJoCo Ant: `python -m benchmarks.learning`.

Random actions, resets and rewards included, alternating in one process; minima over rounds. An
action of ours is 20 steps of 1 ms, one of the Ant's 5 steps of 10 ms by RK4. Gymnasium steps its
Ants one after the other in Python; two threads of ours work, so that processor time is compared.
"""

from __future__ import annotations

import time
from typing import Any

import gymnasium

import pgraph_core.gym

from .machine import machine

ROUNDS, SHORTEST = 9, 0.5
SIZE, ANTS = 512, 16


def rate(env: Any, count: int) -> tuple[float, float]:
    """Actions a second of processor time and of the clock."""
    clock, processor = time.perf_counter(), time.process_time()
    for _ in range(count):
        env.step(env.action_space.sample())
    spent = time.process_time() - processor, time.perf_counter() - clock
    return tuple(env.num_envs * count / x for x in spent)  # type: ignore[return-value]


def main() -> None:
    """A row for each environment."""
    names = list(pgraph_core.gym.ENVIRONMENTS)
    envs = {name: (gymnasium.make_vec(name, num_envs=SIZE, threads=2), 3, 0.02) for name in names}
    ant = gymnasium.make_vec("Ant-v5", num_envs=ANTS, vectorization_mode="sync")
    sides: dict[str, tuple[Any, int, float]] = {**envs, "Ant-v5": (ant, 20, 0.05)}
    for env, count, _ in sides.values():
        env.reset(seed=0)
        env.action_space.seed(0)
        rate(env, 2 * count)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in sides}
    for _ in range(ROUNDS):
        for name, (env, count, _) in sides.items():
            found[name].append(rate(env, count))
    print(machine())
    print("| environment | actions a processor second | a second | simulated s a processor s |")
    print("|---|---|---|---|")
    for name, (_, _, seconds) in sides.items():
        processor, clock = (max(x) for x in zip(*found[name]))
        print(f"| {name} | {processor:.0f} | {clock:.0f} | {processor * seconds:.0f} |")


if __name__ == "__main__":
    main()

"""Peers in the diagram: each installed engine as sides of a study, a sentence for the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from ..peers import PEERS, Peer, installed
from ..peers.exported import Exported, Refused, Trajectory, exported
from .ladder import Setting
from .sides import Outcome, Side
from .task import Progress, Stopped, Task

NOTHING = np.zeros((0, 0))
Once = Callable[[Setting, Callable[[], bool]], Trajectory | None]


def peer_sides(task: Task, rungs: Any, names: Sequence[str]) -> tuple[list[Side], list[str]]:
    """(the sides of the peers that can make the motion, a sentence for each one that cannot)."""
    sides: list[Side] = []
    said: list[str] = []
    for name in names:
        peer = PEERS[name]
        if not installed(name):
            said.append(f"{peer.label} is not installed (pip install {peer.package})")
            continue
        try:
            motion = exported(task.mech, task.q, task.v, task.t, task.scenario, task.tau)
            sides += _sides(name, peer, motion, rungs)
        except Refused as refused:
            said.append(f"{peer.label} is not beside: it is not given {refused}")
        except Exception as error:  # what an engine of another project raises is not known
            said.append(f"{peer.label} is not beside: {_first_line(error)}")
    return sides, said


def _sides(name: str, peer: Peer, motion: Exported, rungs: Any) -> list[Side]:
    run = import_module(f"pgraph_core.peers.in_{name}").Run(motion)
    steps = tuple(Setting(step=h) for h in rungs[0])
    if name == "mujoco":
        return [_side(peer, "rk4", 4.0, steps, lambda s, going: run(s.step, going))]
    if name == "pinocchio":
        tolerances = tuple(Setting(rtol=rtol) for rtol in rungs[1])
        return [
            _side(peer, way, 8.0, tolerances, lambda s, going, way=way: run(way, s.rtol, going))
            for way in run.ways
        ]
    return [
        _side(
            peer, solver, order, steps, lambda s, going, solver=solver: run(solver, s.step, going)
        )
        for solver, order in run.solvers.items()
    ]


def _side(peer: Peer, method: str, order: float, settings: tuple[Setting, ...], once: Once) -> Side:
    def run(setting: Setting, progress: Progress, _: bool) -> Outcome:
        try:
            done = once(setting, lambda: progress(0.0) is not False)
        except Exception as error:  # as above
            if isinstance(error, Stopped):
                raise
            return Outcome(NOTHING, (0.0, 0.0), False, _first_line(error))
        if done is None:
            return Outcome(NOTHING, (0.0, 0.0), False, "", cancelled=True)
        return Outcome(done.q, done.seconds, counters=done.counters)

    return Side(f"{peer.label} {method}", order, settings, run, peer.label)


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]

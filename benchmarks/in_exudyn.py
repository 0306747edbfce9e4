"""A scene in Exudyn: what is timed, on `pgraph_core.peers.in_exudyn`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import exudyn
import numpy as np

from pgraph_core.peers.in_exudyn import coordinates, tree_of, tree_system

from .scenes import STEP, Scene


def build(scene: Scene) -> tuple[Any, Any]:
    """(system container, system) with the scene's state."""
    q, v = scene.state.q, scene.state.v
    tree = tree_of(scene.rows, q, v)
    state = coordinates(scene.rows, tree, q, v)
    container, system, *_ = tree_system(tree.links, *state, scene.model.gravity)
    system.Assemble()
    return container, system


def rk4_steps(scene: Scene, n: int) -> tuple[Callable[[], object], Callable[[], Any]]:
    """(a function that takes n steps under gravity, one that gives its change of the hinges)."""
    kept = build(scene)  # the container too: it must outlive its system
    system = kept[1]
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = n
    settings.timeIntegration.endTime = n * STEP
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.displayStatistics = settings.displayComputationTime = False
    start = system.systemData.GetODE2Coordinates(exudyn.ConfigurationType.Initial)
    hinges = slice(6 if scene.rows[0].kind == "free" else 0, None)

    def run() -> None:
        kept[1].SolveDynamic(settings, solverType=exudyn.DynamicSolverType.RK44)

    def change() -> np.ndarray:
        run()
        return (system.systemData.GetODE2Coordinates() - start)[hinges]

    return run, change

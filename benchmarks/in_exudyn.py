"""A scene in Exudyn, as one kinematic tree of minimal coordinates.

Its joints turn about or slide along an axis of a frame, so a link's frame has z along the axis; a
free root becomes three slides and three turns about x, y, z, which a short run keeps regular.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import exudyn
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree
from scipy.spatial.transform import Rotation

from tests.golden.elementary import inertia_of, sizes

from .scenes import STEP, Scene

Kind = exudyn.JointType
FREE = (
    Kind.PrismaticX,
    Kind.PrismaticY,
    Kind.PrismaticZ,
    Kind.RevoluteX,
    Kind.RevoluteY,
    Kind.RevoluteZ,
)


class Link(NamedTuple):
    """One joint of the tree, in the frame of the link before it."""

    parent: int
    kind: Any
    turn: np.ndarray  # (3, 3) from the parent link's frame
    shift: np.ndarray  # (3,)
    mass: float = 0.0
    com: np.ndarray = np.zeros(3)
    inertia: np.ndarray = np.zeros((3, 3))


def along_z(axis: np.ndarray) -> np.ndarray:
    """(3, 3) rotation that brings z onto the axis."""
    return Rotation.align_vectors(axis[None], [[0, 0, 1]])[0].as_matrix()


def links_of(scene: Scene) -> list[Link]:
    """The joints of all rows: hinges, slides, and a free root."""
    links: list[Link] = []
    last = {-1: (-1, np.eye(3))}
    for i, row in enumerate(scene.rows):
        parent, home = last[row.parent]
        mass, com, inertia = inertia_of(row.body)
        turn, shift = home.T @ row.turn, home.T @ row.shift
        if row.kind == "free":
            assert row.parent < 0
            for n, kind in enumerate(FREE[:-1]):
                links.append(Link(len(links) - 1 if n else -1, kind, turn, shift))
                turn, shift = np.eye(3), np.zeros(3)
            links.append(Link(len(links) - 1, FREE[-1], turn, shift, mass, com, inertia))
            last[i] = (len(links) - 1, np.eye(3))
            continue
        axes = along_z(row.axis)
        kind = Kind.RevoluteZ if row.kind == "rotate" else Kind.PrismaticZ
        at = axes.T @ com, axes.T @ inertia @ axes
        links.append(Link(parent, kind, turn @ axes, shift, mass, *at))
        last[i] = (len(links) - 1, axes)
    return links


def coordinates(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) of Exudyn: a root's quaternion as angles about x, y, z."""
    place, q, v = sizes(scene.rows), [], []
    for i, row in enumerate(scene.rows):
        x = scene.state.q[place.q[i] : place.q[i + 1]]
        y = scene.state.v[place.v[i] : place.v[i + 1]]
        if row.kind != "free":
            q, v = [*q, *x], [*v, *y]
            continue
        angles = Rotation.from_quat(x[3:], scalar_first=True).as_euler("XYZ")
        first, second = (Rotation.from_euler("XYZ", angles * m) for m in ((1, 0, 0), (1, 1, 0)))
        axes = np.column_stack(([1, 0, 0], first.apply([0, 1, 0]), second.apply([0, 0, 1])))
        q, v = [*q, *x[:3], *angles], [*v, *y[3:], *np.linalg.solve(axes, y[:3])]
    return np.array(q), np.array(v)


def build(scene: Scene) -> tuple[Any, Any]:
    """(system container, system) with the scene's state."""
    links = links_of(scene)
    q, v = coordinates(scene)
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        NodeGenericODE2(
            referenceCoordinates=0 * q,
            initialCoordinates=q,
            initialCoordinates_t=v,
            numberOfODE2Coordinates=len(q),
        )
    )
    system.AddObject(
        ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[link.kind for link in links],
            linkParents=[link.parent for link in links],
            jointTransformations=exudyn.Matrix3DList([link.turn for link in links]),
            jointOffsets=exudyn.Vector3DList([link.shift for link in links]),
            linkInertiasCOM=exudyn.Matrix3DList([link.inertia for link in links]),
            linkCOMs=exudyn.Vector3DList([link.com for link in links]),
            linkMasses=[link.mass for link in links],
            gravity=list(scene.model.gravity),
        )
    )
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

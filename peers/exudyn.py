"""Exudyn: a model as one kinematic tree of minimal coordinates, and a motion by its solvers.

Its joints rotate about or slide along an axis of a frame, so a link's frame has z along the axis;
a ball becomes three rotations, a free root three slides and three rotations. The initial spin
decides their order, so that they stay away from the singular position for long.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pgraph_core.rotation import matrix

from .motion import Clocks, Exported, Refused, Trajectory
from .rows import Array, Row, Scene, inertia_of, sizes

NONE = np.zeros((3, 3))
MOST = 300  # degrees of freedom: its mass matrix is dense, and a run cannot be stopped


class Link(NamedTuple):
    """One joint of the tree, in the frame of the link before it."""

    parent: int
    kind: str  # RevoluteX .. PrismaticZ
    turn: Array  # (3, 3) from the parent link's frame
    shift: Array  # (3,)
    mass: float = 0.0
    com: Array = np.zeros(3)
    inertia: Array = NONE


class Tree(NamedTuple):
    """The links, the last one of each row with its frame's axes, and the order of rotations."""

    links: list[Link]
    last: dict[int, tuple[int, Array]]
    orders: dict[int, str]  # orders of coordinates of ball and free rows


def along_z(axis: Array) -> Array:
    """(3, 3) rotation that brings z onto the axis."""
    return Rotation.align_vectors(axis[None], [[0, 0, 1]])[0].as_matrix()


def tree_of(rows: Sequence[Row], q: Array, v: Array) -> Tree:
    """The joints of all rows: hinges, slides, balls, and free roots."""
    tree, at = Tree([], {-1: (-1, np.eye(3))}, {}), sizes(rows)
    for i, row in enumerate(rows):
        parent, home = tree.last[row.parent]
        mass, com, inertia = (0.0, np.zeros(3), NONE) if row.body is None else inertia_of(row.body)
        turn, shift = home.T @ row.turn, home.T @ row.shift
        if row.kind in ("rotate", "translate"):
            axes = along_z(row.axis)
            kind = "RevoluteZ" if row.kind == "rotate" else "PrismaticZ"
            own = mass, axes.T @ com, axes.T @ inertia @ axes
            tree.links.append(Link(parent, kind, turn @ axes, shift, *own))
            tree.last[i] = (len(tree.links) - 1, axes)
            continue
        if row.kind not in ("ball", "free") or (row.kind == "free" and row.parent >= 0):
            raise Refused(f"it has a joint of kind {row.kind} (body '{row.name}')")
        order = _order(q[at.q[i] : at.q[i + 1]], v[at.v[i] : at.v[i] + 3])
        kinds = [f"Prismatic{axis}" for axis in "XYZ"] if row.kind == "free" else []
        kinds += [f"Revolute{axis}" for axis in order]
        for n, kind in enumerate(kinds):
            link = Link(parent, kind, turn, shift)
            last = n == len(kinds) - 1
            tree.links.append(link._replace(mass=mass, com=com, inertia=inertia) if last else link)
            parent, turn, shift = len(tree.links) - 1, np.eye(3), np.zeros(3)
        tree.last[i], tree.orders[i] = (len(tree.links) - 1, np.eye(3)), order
    return tree


def _order(place: Array, spin: Array) -> str:
    """Three axes, the last one closest to the spin in body axes, the first closest to z."""
    body = np.abs(matrix(place[-4:].tolist()).T @ spin)
    last = "XYZ"[int(np.argmax(body))] if body.max() > 0 else "Z"
    first, middle = {"X": "ZY", "Y": "ZX", "Z": "XY"}[last]
    return first + middle + last


def coordinates(rows: Sequence[Row], tree: Tree, q: Array, v: Array) -> tuple[Array, Array]:
    """(q, v) of Exudyn: quaternions as three rotations."""
    at = sizes(rows)
    found: tuple[list[float], list[float]] = [], []
    for i, row in enumerate(rows):
        x, y = q[at.q[i] : at.q[i + 1]], v[at.v[i] : at.v[i + 1]]
        if row.kind not in ("ball", "free"):
            found[0].extend(x)
            found[1].extend(y)
            continue
        order = tree.orders[i]
        angles = Rotation.from_quat(x[-4:], scalar_first=True).as_euler(order)
        axes = np.column_stack(_axes(order, angles))
        found[0].extend((*x[:-4], *angles))
        found[1].extend((*y[3:], *np.linalg.solve(axes, y[:3])))
    return np.array(found[0]), np.array(found[1])


def _axes(order: str, angles: Array) -> tuple[Array, Array, Array]:
    """The axes of the three rotations, in the parent's axes."""
    unit = dict(zip("XYZ", np.eye(3)))
    first = Rotation.from_euler(order[0], angles[0])
    second = first * Rotation.from_euler(order[1], angles[1])
    return unit[order[0]], first.apply(unit[order[1]]), second.apply(unit[order[2]])


def ours(rows: Sequence[Row], tree: Tree, theirs: Array) -> Array:
    """(n, nq) Pgraph's coordinates from Exudyn's."""
    parts, j = [], 0
    for i, row in enumerate(rows):
        if row.kind not in ("ball", "free"):
            parts.append(theirs[:, j : j + 1])
            j += 1
            continue
        if row.kind == "free":
            parts.append(theirs[:, j : j + 3])
            j += 3
        turns = Rotation.from_euler(tree.orders[i], theirs[:, j : j + 3])
        parts.append(turns.as_quat(scalar_first=True))
        j += 3
    return np.concatenate(parts, axis=1)


def tree_system(
    links: list[Link], q: Array, v: Array, gravity: Any, control: dict[str, Any] | None = None
) -> tuple[Any, Any, int, int]:
    """(container, system, number of the tree's node, number of the tree)."""
    exudyn, items = import_module("exudyn"), import_module("exudyn.itemInterface")
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=0 * q,
            initialCoordinates=q,
            initialCoordinates_t=v,
            numberOfODE2Coordinates=len(q),
        )
    )
    tree = system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[getattr(exudyn.JointType, link.kind) for link in links],
            linkParents=[link.parent for link in links],
            jointTransformations=exudyn.Matrix3DList([link.turn for link in links]),
            jointOffsets=exudyn.Vector3DList([link.shift for link in links]),
            linkInertiasCOM=exudyn.Matrix3DList([link.inertia for link in links]),
            linkCOMs=exudyn.Vector3DList([link.com for link in links]),
            linkMasses=[link.mass for link in links],
            gravity=list(gravity),
            **(control or {}),
        )
    )
    return container, system, node, tree


def alone_system(row: Row, q: Array, v: Array, gravity: Any) -> tuple[Any, Any, int]:
    """(container, system, node) of one body on a ball or free joint, by a Lie-group node."""
    exudyn, items = import_module("exudyn"), import_module("exudyn.itemInterface")
    assert row.body is not None
    mass, com, inertia = inertia_of(row.body)
    about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
    R = row.turn @ matrix(q[-4:].tolist())
    place = row.shift + (row.turn @ q[:3] if row.kind == "free" else 0.0)
    moving = row.turn @ v[3:] if row.kind == "free" else np.zeros(3)
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        items.NodeRigidBodyRotVecLG(
            referenceCoordinates=[*place, *Rotation.from_matrix(R).as_rotvec()],
            initialVelocities=[*moving, *(R.T @ row.turn @ v[:3])],
        )
    )
    held = row.kind == "ball"  # the pivot as centre: gravity's force is removed, its torque stays
    centre = np.zeros(3) if held else com
    body = system.AddObject(
        items.ObjectRigidBody(
            nodeNumber=node,
            physicsMass=mass,
            physicsCenterOfMass=list(centre),
            physicsInertia=[*np.diag(about), about[1, 2], about[0, 2], about[0, 1]],
        )
    )
    for point, sign in ((com, 1.0), (np.zeros(3), -1.0)) if held else ((com, 1.0),):
        mark = system.AddMarker(items.MarkerBodyRigid(bodyNumber=body, localPosition=list(point)))
        force = list(sign * mass * np.array(gravity))
        system.AddLoad(items.LoadForceVector(markerNumber=mark, loadVector=force))
    return container, system, node


# -- dynamics at a state ---------------------------------------------------------------------------


def build(scene: Scene) -> tuple[Any, Any]:
    """(system container, system) in the scene's state."""
    q, v = scene.state.q, scene.state.v
    tree = tree_of(scene.rows, q, v)
    state = coordinates(scene.rows, tree, q, v)
    container, system, *_ = tree_system(tree.links, *state, scene.model.gravity)
    system.Assemble()
    return container, system


def rk4_steps(
    scene: Scene, step: float, n: int
) -> tuple[Callable[[], object], Callable[[], Array]]:
    """(a function that takes n steps under gravity, one that returns the change of the hinges)."""
    exudyn = import_module("exudyn")
    kept = build(scene)  # the container too: it must outlive its system
    system = kept[1]
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = n
    settings.timeIntegration.endTime = n * step
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.displayStatistics = settings.displayComputationTime = False
    start = system.systemData.GetODE2Coordinates(exudyn.ConfigurationType.Initial)
    hinges = slice(6 if scene.rows[0].kind == "free" else 0, None)

    def run() -> None:
        kept[1].SolveDynamic(settings, solverType=exudyn.DynamicSolverType.RK44)

    def change() -> Array:
        run()
        return (system.systemData.GetODE2Coordinates() - start)[hinges]

    return run, change


# -- a motion --------------------------------------------------------------------------------------


class Run:
    """A motion, built once and run at any step."""

    by = "step"

    def __init__(self, motion: Exported):
        """Raises Refused if a kinematic tree cannot represent the motion."""
        for row in motion.rows:
            if row.armature:
                raise Refused(f"it has armature (body '{row.name}')")
        apart = np.diff(motion.t)
        if np.ptp(apart) > 1e-9 * motion.t[-1]:
            raise Refused("its times are not evenly spaced")
        self.motion = motion
        self.exudyn = import_module("exudyn")
        items = import_module("exudyn.itemInterface")
        self.alone = len(motion.rows) == 1 and motion.rows[0].kind in ("ball", "free")
        if len(motion.v) > MOST:
            raise Refused(
                f"it has more than {MOST} degrees of freedom, and a run cannot be stopped"
            )
        kinds = self.exudyn.OutputVariableType
        if self.alone:
            made = alone_system(motion.rows[0], motion.q, motion.v, motion.model.gravity)
            self.container, self.system, node = made  # the container must outlive it
            wanted = (kinds.Position, kinds.RotationMatrix)
        else:
            node = self._grow(items)
            wanted = (kinds.Coordinates,)
        self.sensors = [
            self.system.AddSensor(
                items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind)
            )
            for kind in wanted
        ]
        self.system.Assemble()
        solvers = ("TrapezoidalIndex2",) if motion.pins else ("RK44", "RK67")
        self.methods = {name: partial(self, name) for name in solvers}

    def _grow(self, items: Any) -> int:
        """Add a kinematic tree with its actuators and pinned points and return its node number."""
        motion = self.motion
        self.tree = tree_of(motion.rows, motion.q, motion.v)
        q, v = coordinates(motion.rows, self.tree, motion.q, motion.v)
        control = self._control(len(q))
        made = tree_system(self.tree.links, q, v, motion.model.gravity, control)
        self.container, self.system, node, self.number = made
        self._pin(items)
        return node

    def _control(self, n: int) -> dict[str, Any]:
        """Proportional and derivative control of joints."""
        if not self.motion.actuators:
            return {}
        at_v = sizes(self.motion.rows).v
        first = [link for link, _ in (self.tree.last[i] for i in range(len(at_v) - 1))]
        self.joints = [first[a.row] for a in self.motion.actuators]
        kp, kd = np.zeros(n), np.zeros(n)
        for joint, each in zip(self.joints, self.motion.actuators):
            kp[joint], kd[joint] = each.kp, each.kd
        return {
            "jointPControlVector": list(kp),
            "jointDControlVector": list(kd),
            "jointPositionOffsetVector": [0.0] * n,
            "jointVelocityOffsetVector": [0.0] * n,
            "jointForceVector": list(self._force(0.0, n)),
        }

    def _force(self, t: float, n: int) -> Array:
        found = np.zeros(n)
        for joint, each in zip(self.joints, self.motion.actuators):
            found[joint] = np.interp(t, each.t, each.u)
        return found

    def _pin(self, items: Any) -> None:
        if not self.motion.pins:
            return
        ground = self.system.AddObject(items.ObjectGround())
        for pin in self.motion.pins:
            foot = self._marked(items, pin.row, pin.point)
            place = (
                self.system.AddMarker(
                    items.MarkerBodyRigid(bodyNumber=ground, localPosition=list(pin.place))
                )
                if pin.other < 0
                else self._marked(items, pin.other, pin.place)
            )
            self.system.AddObject(items.ObjectJointSpherical(markerNumbers=[foot, place]))

    def _marked(self, items: Any, row: int, point: Array) -> Any:
        """A marker at a point of a row."""
        link, axes = self.tree.last[row]
        return self.system.AddMarker(
            items.MarkerKinematicTreeRigid(
                objectNumber=self.number, linkNumber=link, localPosition=list(axes.T @ point)
            )
        )

    def __call__(self, solver: str, step: float, going: Callable[[], bool]) -> Trajectory | None:
        """Run a method at a step that divides the output's spacing. It cannot be stopped."""
        motion, spacing = self.motion, float(self.motion.t[1])
        each = max(1, int(np.ceil(spacing / step - 1e-9)))
        settings = self._settings(each * (len(motion.t) - 1), motion.t[-1], spacing)
        if any(len(a.t) > 1 for a in motion.actuators):
            self.system.SetPreStepUserFunction(self._follow)
            self._follow(self.system, 0.0)
        clocks = Clocks()
        kind = getattr(self.exudyn.DynamicSolverType, solver)
        self.system.SolveDynamic(settings, solverType=kind, showHints=False, showCausingItems=False)
        seconds = clocks.read()
        return Trajectory(self._states(spacing), seconds, {"steps": each * (len(motion.t) - 1)})

    def _states(self, spacing: float) -> Array:
        """(n, nq) the states that its sensors recorded, in Pgraph's coordinates."""
        motion, found = self.motion, []
        for sensor in self.sensors:
            kept = self.system.GetSensorStoredData(sensor)
            found.append(kept[np.searchsorted(kept[:, 0], motion.t - 1e-6 * spacing), 1:])
        if not self.alone:
            return ours(motion.rows, self.tree, found[0])
        row = motion.rows[0]
        turns = row.turn.T @ found[1].reshape(-1, 3, 3)
        place = (found[0] - row.shift) @ row.turn if row.kind == "free" else found[0][:, :0]
        found_q = Rotation.from_matrix(turns).as_quat(scalar_first=True)
        return np.concatenate((place, found_q), axis=1)

    def _settings(self, steps: int, t_end: float, spacing: float) -> Any:
        settings = self.exudyn.SimulationSettings()
        settings.timeIntegration.numberOfSteps = steps
        settings.timeIntegration.endTime = t_end
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.automaticStepSize = False
        settings.timeIntegration.adaptiveStep = False
        settings.timeIntegration.newton.relativeTolerance = 1e-10
        settings.timeIntegration.newton.absoluteTolerance = 1e-12
        if self.motion.pins:  # their rows may be redundant
            settings.linearSolverType = self.exudyn.LinearSolverType.EigenDense
            settings.linearSolverSettings.ignoreSingularJacobian = True
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = spacing
        settings.displayStatistics = settings.displayComputationTime = False
        return settings

    def _follow(self, system: Any, t: float) -> bool:
        n = len(self.tree.links)
        system.SetObjectParameter(self.number, "jointForceVector", list(self._force(t, n)))
        return True

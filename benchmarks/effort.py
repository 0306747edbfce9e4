"""The effort to write and to start three machines, in our formats and in those of the peers.

The files are in `machines/`, written as their users would, without values that equal the defaults.
All formats of a machine give the same accelerations of its hinges before anything is timed; of
Exudyn the velocities after one RK4 step are compared. `values` are what a person has to know and
type; on the page they are cells. `characters` leave out white space and comments.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import ROOT, has
from .measure import Effort, Row, differ, in_turns

MINUTES = 3.0
PEERS = ("mujoco", "pin", "drake", "exudyn")
HERE = Path(__file__).parent / "machines"
MACHINES = {
    "double_pendulum": "double pendulum",
    "fig1_tree": "tree of the paper's Fig. 1",
    "quadruped": "quadruped of 16 bodies",
}
ANGLE, SPEED = 0.2, 1.0  # of every hinge [rad, rad/s]
STEP = 1e-3  # Exudyn's first [s]
FRESH = 5  # new processes


def rows(effort: Effort) -> Iterator[Row]:
    labels = [label for label, (peer, *_) in FORMATS.items() if not peer or has(peer)]
    for name, title in list(MACHINES.items())[: effort.pick(None, 1)]:
        calls = {label: partial(FORMATS[label][2], name) for label in labels}
        running = in_turns(calls, effort.pick(20, 2), 1e-3)
        new = {label: partial(fresh, name, label) for label in labels}
        started = {} if effort.quick else in_turns(new, FRESH, 0.0, clocked=set(new))
        yield row(title, "Pgraph, page", cells(name))
        for label in labels:
            path = HERE / f"{name}{FORMATS[label][1]}" if FORMATS[label][1] else own_file(name)
            agrees = agreement(name, label) if label != "Pgraph" else ""
            from_nothing = min(started[label]) if started else None
            found = *written(path), 1e3 * min(running[label]), from_nothing, agrees
            yield row(title, label, *found)


def row(
    title: str, form: str, values: int, characters: int | None = None,
    milliseconds: float | None = None, seconds: float | None = None, agrees: str = "",
) -> Row:  # fmt: skip
    """A line of the table; a person who fills in the page types no file."""
    return {
        "case": title, "in": form, "values": values, "characters": characters,
        "from file to accelerations [ms]": milliseconds, "in a new process [s]": seconds,
        "differs": agrees,
    }  # fmt: skip


def fresh(name: str, label: str) -> float:
    """Processor time [s] of a new process that gets as far as the first accelerations."""
    script = f"from benchmarks.effort import FORMATS; FORMATS[{label!r}][2]({name!r})"
    before = os.times()
    subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True, capture_output=True)
    after = os.times()
    used = after.children_user + after.children_system
    return used - before.children_user - before.children_system


def own_file(name: str) -> Path:
    """Our own file of a machine."""
    path = HERE / f"{name}.json"
    return path if path.exists() else HERE / f"{name}_pgraph.py"


# -- from a file to the first accelerations --------------------------------------------------------


def ours(name: str) -> dict[str, float]:
    """Accelerations of the hinges, by name."""
    mech = mechanism(name)
    q, v = at_angles(mech)
    vdot = mech.forward_dynamics(q, v)
    return {hinge: float(vdot[mech.joints[hinge].v][0]) for hinge in hinges(mech)}


def mechanism(name: str) -> Any:
    """Ours, from its script or its file."""
    path = HERE / f"{name}.json"
    return pg.Mechanism(pg.Model.load(path)) if path.exists() else _script(f"{name}_pgraph")


def hinges(mech: Any) -> list[str]:
    """Names of the bodies whose joints are hinges."""
    return [name for name, joint in mech.joints.items() if joint.kinds == (0,)]


def at_angles(mech: Any) -> tuple[np.ndarray, np.ndarray]:
    """Every hinge at ANGLE and SPEED."""
    q, v = mech.home()
    for name in hinges(mech):
        q[mech.joints[name].q], v[mech.joints[name].v] = ANGLE, SPEED
    return q, v


def mjcf(name: str) -> dict[str, float]:
    """MuJoCo's, from MJCF."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(HERE / f"{name}.xml"))
    data = mujoco.MjData(model)
    turning = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE]
    data.qpos[model.jnt_qposadr[turning]] = ANGLE
    data.qvel[model.jnt_dofadr[turning]] = SPEED
    mujoco.mj_forward(model, data)
    return {model.joint(j).name: float(data.qacc[model.jnt_dofadr[j]]) for j in turning}


def urdf(name: str) -> dict[str, float]:
    """Pinocchio's, from URDF."""
    import pinocchio as pin

    free = name == "quadruped"
    root = (pin.JointModelFreeFlyer(),) if free else ()
    model = pin.buildModelFromUrdf(str(HERE / f"{name}.urdf"), *root)
    if free:
        model.gravity.linear = np.array([0.0, -9.81, 0.0])
    data = model.createData()
    turn, v, tau = np.zeros((3, model.nv))
    turn[6 * free :], v[6 * free :] = ANGLE, SPEED
    vdot = pin.aba(model, data, pin.integrate(model, pin.neutral(model), turn), v, tau)
    names = list(model.names)[1 + free :]
    return {hinge: float(vdot[model.joints[model.getJointId(hinge)].idx_v]) for hinge in names}


def drake(name: str) -> dict[str, float]:
    """Drake's, from its script."""
    plant = _script(f"{name}_drake")
    context = plant.CreateDefaultContext()
    joints = [plant.get_joint(j) for j in plant.GetJointIndices()]
    turning = [joint for joint in joints if joint.num_velocities() == 1]
    for joint in turning:
        joint.set_angle(context, ANGLE)
        joint.set_angular_rate(context, SPEED)
    vdot = plant.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
    return {joint.name(): float(vdot[joint.velocity_start()]) for joint in turning}


def exudyn(name: str) -> dict[str, float]:
    """Exudyn's velocities after one step, from its script."""
    import exudyn as exu

    _, mbs = kept = _script(f"{name}_exudyn")  # the container too: it must outlive its system
    module = import_module(f"{__package__}.machines.{name}_exudyn")
    names = [row[0] for row in module.ROWS][name == "quadruped" :]
    first = 6 if name == "quadruped" else 0
    q, v = np.zeros((2, first + len(names)))
    q[first:], v[first:] = ANGLE, SPEED
    mbs.systemData.SetODE2Coordinates(q, exu.ConfigurationType.Initial)
    mbs.systemData.SetODE2Coordinates_t(v, exu.ConfigurationType.Initial)
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = 1, STEP
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.displayStatistics = settings.displayComputationTime = False
    kept[1].SolveDynamic(settings, solverType=exu.DynamicSolverType.RK44)
    v = mbs.systemData.GetODE2Coordinates_t()[first:]
    return dict(zip(names, map(float, v)))


def _script(module: str) -> Any:
    """The result of its `build`; read and compiled again each time, like a file."""
    full = f"{__package__}.machines.{module}"
    sys.modules.pop(full, None)
    return import_module(full).build()


# format, the peer it needs, its file's ending, how it starts
FORMATS: dict[str, tuple[str, str, Callable[[str], dict[str, float]]]] = {
    "Pgraph": ("", "", ours),
    "MJCF (MuJoCo)": ("mujoco", ".xml", mjcf),
    "URDF (Pinocchio)": ("pin", ".urdf", urdf),
    "script (Drake)": ("drake", "_drake.py", drake),
    "script (Exudyn)": ("exudyn", "_exudyn.py", exudyn),
}


def agreement(name: str, label: str) -> str:
    """How far a format's accelerations are from ours, relative."""
    found = FORMATS[label][2](name)
    expected = after_one_step(name) if label == "script (Exudyn)" else ours(name)
    values = [np.array([x[hinge] for hinge in expected]) for x in (found, expected)]
    return differ(*values, 1e-6, f"{name}, {label}")


def after_one_step(name: str) -> dict[str, float]:
    """Our velocities of the hinges after one RK4 step."""
    mech = mechanism(name)
    run = pg.simulate(mech, *at_angles(mech), t_end=STEP, step=STEP, method="rk4")
    return {hinge: float(run.v[-1][mech.joints[hinge].v][0]) for hinge in hinges(mech)}


# -- counting --------------------------------------------------------------------------------------


def written(path: Path) -> tuple[int, int]:
    """(values, characters) of a file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        tree = ast.parse(text)
        del tree.body[0]  # its docstring
        text = ast.unparse(tree)
        values = sum(isinstance(node, ast.Constant) for node in ast.walk(tree))
    elif path.suffix == ".json":
        values = leaves(json.loads(text))
    else:
        items = ElementTree.fromstring(text).iter()
        values = sum(len(x.split()) for item in items for x in item.attrib.values())
    return values, len("".join(text.split()))


def leaves(data: Any) -> int:
    """Names and numbers in JSON data."""
    if isinstance(data, dict):
        return sum(map(leaves, data.values()))
    return sum(map(leaves, data)) if isinstance(data, list) else 1


def cells(name: str) -> int:
    """Cells to fill in on the page: the number of bodies, and values that differ from defaults."""
    model = mechanism(name).model
    default = pg.Model.serial(len(model.bodies))
    count = 1 + (model.gravity != default.gravity)  # that one is the choice of what is up
    for body, rod in zip(model.bodies, default.bodies):
        parent = default.body(rod.parent).name if rod.parent != "ground" else "ground"
        above = model.bodies[default.row[parent]].name if parent != "ground" else "ground"
        count += (body.name != rod.name) + (body.parent != above) + (body.dof != rod.dof)
        count += sum(x != y for x, y in zip(flat(body), flat(rod)))
    return count


def flat(body: Any) -> list[float]:
    """Cells of a row except name, parent and DoF; an axis is one choice."""
    inertia = [body.inertia[i][j] for i in range(3) for j in range(i, 3)]
    axis = [hash(body.axes)] if body.joint == "revolute" else [0.0]
    return [*axis, *body.link, body.mass, *body.com, *inertia]

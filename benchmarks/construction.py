"""The effort to write and to start three machines, in our formats and those of the peers.

`python -m benchmarks.construction` prints docs/construction.md; with the names of a machine and a
format it takes that from its file to the first accelerations, and no more.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .machine import ROOT, has, machine

HERE = Path(__file__).parent / "machines"
MACHINES = {
    "double_pendulum": "double pendulum",
    "fig1_tree": "tree of the paper's Fig. 1",
    "quadruped": "quadruped of 16 bodies",
}
ANGLE, SPEED = 0.2, 1.0  # of every hinge [rad, rad/s]
STEP = 1e-3  # Exudyn's first [s]
FRESH = 5  # processes
TEXT = """# Modelling effort and start-up time

Made by `python -m benchmarks.construction`. Three machines, in Pgraph's formats and in those of the
peers, written as their users would, without values that equal the defaults
(`benchmarks/machines/`). All formats of a machine give the same accelerations of its hinges before
anything is timed (last column: largest relative difference from Pgraph; for Exudyn, of the
velocities after one RK4 step).

* *values*: what a person has to know and type: names, numbers, choices. On the page these are
  cells: the number of bodies, then every cell of the default table that has to change.
* *characters*: of the file, without white space and comments.
* *running*: from the file to the first accelerations, everything imported: least processor time of
  20.
* *from nothing*: the same in a new process, imports included: least processor time of {fresh}, with
  the formats taking turns, so that other work on the machine does not decide.

A machine close to the default table takes a few cells. If every number is its own, as for the
quadruped, defaults save little; the table then saves nesting, tags and the repeated names of
bodies. From nothing Pgraph is the slowest: Python imports numba and pydantic, and loads compiled
kernels.

Measured on {machine}.
"""


# -- from a file to the first accelerations --------------------------------------------------------


def ours(name: str) -> dict[str, float]:
    """Accelerations of the hinges, by name."""
    mech = mechanism(name)
    q, v = at_angles(mech)
    vdot = mech.forward_dynamics(q, v)
    return {hinge: float(vdot[mech.joints[hinge].v][0]) for hinge in hinges(mech)}


def mechanism(name: str) -> Any:
    """Ours, from its script or its file."""
    import pgraph_core as pg

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
FORMATS: dict[str, tuple[str | None, str, Callable[[str], dict[str, float]]]] = {
    "Pgraph": (None, "", ours),
    "MJCF (MuJoCo)": ("mujoco", ".xml", mjcf),
    "URDF (Pinocchio)": ("pin", ".urdf", urdf),
    "script (Drake)": ("drake", "_drake.py", drake),
    "script (Exudyn)": ("exudyn", "_exudyn.py", exudyn),
}


def differ(name: str, label: str) -> float:
    """How far a format's accelerations are from ours, relative. Exits where they do not agree."""
    found, expected = FORMATS[label][2](name), ours(name)
    if label == "script (Exudyn)":
        expected = after_one_step(name)
    assert found.keys() == expected.keys(), (label, name, found.keys(), expected.keys())
    size = max(map(abs, expected.values()))
    error = max(abs(found[hinge] - expected[hinge]) for hinge in expected) / size
    if not error < 1e-6:
        raise SystemExit(f"{name}, {label}: differs by {error:.2e}; nothing is timed")
    return error


def after_one_step(name: str) -> dict[str, float]:
    """Our velocities of the hinges after one RK4 step."""
    import pgraph_core as pg

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
    import pgraph_core as pg

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


# -- the document ----------------------------------------------------------------------------------


def running(name: str, label: str) -> float:
    """Least processor time [s] to the first accelerations in this process."""
    times = []
    for _ in range(20):
        begin = time.process_time()
        FORMATS[label][2](name)
        times.append(time.process_time() - begin)
    return min(times)


def from_nothing(name: str, labels: list[str]) -> dict[str, float]:
    """Least processor time [s] of new processes that get as far, by format, in turns."""
    return {
        label: min(times)
        for label, *times in zip(labels, *([_fresh(name, x) for x in labels] for _ in range(FRESH)))
    }


def _fresh(name: str, label: str) -> float:
    """Processor time [s] of a new process."""
    before = os.times()
    command = [sys.executable, "-m", "benchmarks.construction", name, label]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    after = os.times()
    used = (after.children_user, after.children_system)
    return sum(used) - before.children_user - before.children_system


def lines() -> Iterator[tuple[str, ...]]:
    """The rows of the table."""
    labels = [x for x, (peer, *_) in FORMATS.items() if peer is None or has(peer)]
    for name, title in MACHINES.items():
        yield title, "Pgraph, page", str(cells(name)), "", "", "", ""
        fresh = from_nothing(name, labels)
        for label in labels:
            peer, ending, _ = FORMATS[label]
            path = HERE / f"{name}{ending}" if ending else _ours(name)
            values, characters = written(path)
            error = differ(name, label)
            times = f"{1e3 * running(name, label):.2g} ms", f"{fresh[label]:.2f} s"
            shown = f"{error:.0e}" if label != "Pgraph" else ""
            label = (
                f"Pgraph, {'file' if path.suffix == '.json' else 'script'}" if not peer else label
            )
            yield "", label, str(values), str(characters), *times, shown


def _ours(name: str) -> Path:
    path = HERE / f"{name}.json"
    return path if path.exists() else HERE / f"{name}_pgraph.py"


def document() -> str:
    """docs/construction.md."""
    from .report import machine as shown
    from .report import piped

    head = TEXT.format(fresh=FRESH, machine=shown({"machine": machine()}))
    columns = ("machine", "in", "values", "characters", "running", "from nothing", "differs")
    return f"{head}\n{piped(columns, list(lines()))}\n"


if __name__ == "__main__":
    if len(sys.argv) == 3:
        FORMATS[sys.argv[2]][2](sys.argv[1])
    else:
        print(document(), end="")

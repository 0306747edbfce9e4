"""A motion in MuJoCo, built with MjSpec: text is too deep for its parser beyond 500 bodies.

Drives become actuators of linear bias whose activation is integrated, so that MuJoCo's own RK4
sees u(t) at its stages; points that hold are `connect` constraints, which are soft there.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from ..rotation import matrix
from ..system import Array
from .elementary import PLACEHOLDER, Row, inertia_of, sizes
from .exported import Clocks, Drive, Exported, Trajectory

LEAST_INERTIA = 2e-15  # kg m^2: MuJoCo refuses moving bodies without inertia
SPECK = 1e-13  # kg, kg m^2 of rows between the motions of a joint: it wants some there too


def integrators() -> dict[str, Any]:
    """Its integrators, by our names."""
    kinds = import_module("mujoco").mjtIntegrator
    return {"semi_implicit_euler": kinds.mjINT_EULER, "rk4": kinds.mjINT_RK4}


def spec_builder(
    rows: list[Row], gravity: Any, step: float, method: str = "rk4"
) -> Callable[[], Any]:
    """A function that builds the spec of a tree from numbers that are at hand."""
    mujoco = import_module("mujoco")
    prepared = [_arguments(row) for row in rows]
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT

    def build() -> Any:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.compiler.boundmass = spec.compiler.boundinertia = 0
        spec.option.gravity = gravity
        spec.option.timestep, spec.option.integrator = step, integrators()[method]
        spec.option.disableflags |= off
        bodies = [spec.worldbody]
        for parent, body, joint in prepared:
            bodies.append(bodies[parent + 1].add_body(**body))
            if joint == "free":
                bodies[-1].add_freejoint()
            elif joint:
                bodies[-1].add_joint(**joint)
        return spec

    return build


def _arguments(row: Row) -> tuple[int, dict[str, Any], Any]:
    """(parent, of add_body, of add_joint) for a row."""
    kinds = import_module("mujoco").mjtJoint
    mass, com, inertia = SPECK, np.zeros(3), SPECK * np.eye(3)
    if row.body is not None:
        mass, com, inertia = inertia_of(row.body)
    xx, yy, zz = np.diag(inertia)
    body = {
        "name": row.name,
        "pos": row.shift,
        "quat": _quaternion(row.turn),
        "mass": mass,
        "ipos": com,
        "fullinertia": [xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]],
        "explicitinertial": True,
    }
    if row.kind == PLACEHOLDER:
        return row.parent, body, None
    if row.kind == "free":
        return row.parent, body, "free"
    kind = {"rotate": kinds.mjJNT_HINGE, "translate": kinds.mjJNT_SLIDE, "ball": kinds.mjJNT_BALL}
    joint = {"name": row.name, "type": kind[row.kind], "axis": row.axis, "armature": row.armature}
    return row.parent, body, joint


def _quaternion(turn: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(turn).as_quat(scalar_first=True)


def coordinates(rows: list[Row], q: Array, v: Array) -> tuple[Array, Array]:
    """MuJoCo's qpos, and T with qvel = T v: linear first, angular in body axes. T is orthogonal.

    A root's free joint holds the place in the world, a free motion further out three slides.
    """
    at = sizes(rows)
    found, T = [], np.eye(len(v))
    for i, row in enumerate(rows):
        ours, j = q[at.q[i] : at.q[i + 1]], at.v[i]
        root = row.kind == "free" and row.parent < 0
        found += [*(ours[:3] + row.shift), *ours[3:]] if root else list(ours)
        if row.kind == "ball":
            T[j : j + 3, j : j + 3] = matrix(ours.tolist()).T
        elif row.kind == "free":
            none, local = np.zeros((3, 3)), matrix(ours[3:].tolist()).T
            T[j : j + 6, j : j + 6] = np.block([[none, np.eye(3)], [local, none]])
    return np.array(found), T


def ours(rows: list[Row], qpos: Array) -> Array:
    """(n, nq) our coordinates from MuJoCo's."""
    at, q = sizes(rows), qpos.copy()
    for i, row in enumerate(rows):
        if row.kind == "free" and row.parent < 0:
            q[:, at.q[i] : at.q[i] + 3] -= row.shift
    return q


class Run:
    """A compiled model of a motion, run again and again at steps of any width."""

    def __init__(self, motion: Exported):
        """Built once. Raises what MuJoCo raises where it cannot compile the model."""
        self.mujoco = import_module("mujoco")
        self.motion = motion
        spec = spec_builder(motion.rows, motion.model.gravity, 1e-3)()
        bare = any(_without_inertia(row) for row in motion.rows)
        spec.compiler.boundinertia = LEAST_INERTIA if bare else 0
        for drive in motion.drives:
            self._drive(spec, drive)
        if motion.holds:
            self._hold(spec)
        self.model = spec.compile()
        self.data = self.mujoco.MjData(self.model)

    def _drive(self, spec: Any, drive: Drive) -> None:
        kinds = self.mujoco
        actuator = spec.add_actuator(
            target=self.motion.rows[drive.row].name,
            trntype=kinds.mjtTrn.mjTRN_JOINT,
            dyntype=kinds.mjtDyn.mjDYN_INTEGRATOR,
            gaintype=kinds.mjtGain.mjGAIN_FIXED,
            biastype=kinds.mjtBias.mjBIAS_AFFINE,
        )
        actuator.gainprm[0] = 1.0
        actuator.biasprm[1], actuator.biasprm[2] = -drive.kp, -drive.kd

    def _hold(self, spec: Any) -> None:
        spec.option.disableflags &= ~int(self.mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        spec.option.jacobian = self.mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.tolerance = 1e-14
        for hold in self.motion.holds:
            place = spec.worldbody.add_site(name=f"{hold.name}:there", pos=hold.place)
            body = spec.body(self.motion.rows[hold.row].name)
            foot = body.add_site(name=f"{hold.name}:here", pos=hold.point)
            spec.add_equality(
                type=self.mujoco.mjtEq.mjEQ_CONNECT,
                objtype=self.mujoco.mjtObj.mjOBJ_SITE,
                name1=foot.name,
                name2=place.name,
                solimp=[0.9999, 0.9999, 0.001, 0.5, 2],
            )

    def __call__(self, step: float, going: Callable[[], bool]) -> Trajectory | None:
        """RK4 at this step; None where `going` said no."""
        motion, model, data = self.motion, self.model, self.data
        self.mujoco.mj_resetData(model, data)
        qpos, T = coordinates(motion.rows, motion.q, motion.v)
        data.qpos[:], data.qvel[:] = qpos, T @ motion.v
        data.act[:] = [np.interp(0.0, d.t, d.u) for d in motion.drives]
        if model.neq:
            model.eq_solref[:, 0] = 2.0 * step  # as stiff as the step allows
        stops = motion.knots
        counts = np.maximum(np.ceil(np.diff(stops) / step - 1e-9), 1).astype(int)
        rates = [np.diff(np.interp(stops, d.t, d.u)) / np.diff(stops) for d in motion.drives]
        wanted = np.searchsorted(stops, motion.t)
        kept = np.empty((len(stops), model.nq))
        kept[0] = data.qpos
        clocks = Clocks()
        for k, count in enumerate(counts.tolist()):
            model.opt.timestep = (stops[k + 1] - stops[k]) / count
            for i, rate in enumerate(rates):
                data.ctrl[i] = rate[k]
            self.mujoco.mj_step(model, data, count)
            kept[k + 1] = data.qpos
            if not going():
                return None
        seconds = clocks.read()
        steps = int(counts.sum())
        counters = {"steps": steps, "evaluations": 4 * steps}
        return Trajectory(ours(motion.rows, kept[wanted]), seconds, counters)


def _without_inertia(row: Row) -> bool:
    return row.body is not None and min(np.diag(np.array(row.body.inertia))) < LEAST_INERTIA

"""MuJoCo: a model built with MjSpec, its dynamics at a state, and a motion by its RK4.

Actuators have linear bias, and their activation is integrated, so that MuJoCo's RK4 sees u(t) at
its stages; pinned points are `connect` constraints, which are soft in MuJoCo.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pgraph_core import Model, Shape
from pgraph_core.rotation import matrix
from pgraph_core.shapes import kind_of

from .motion import Actuator, Clocks, Exported, Trajectory
from .rows import PLACEHOLDER, PLAIN, Array, Row, Scene, State, inertia_of, rows_of, sizes, walk

LEAST_INERTIA = 2e-15  # kg m^2: MuJoCo refuses moving bodies without inertia
SPECK = 1e-13  # kg, kg m^2: bodies between the motions of a joint need some too
SOFT = {"solref": [0.002, 1.0], "solimp": [0.99, 0.999, 0.001, 0.5, 2.0]}  # near its stiffest
STIFF = {"solref": [0.0005, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0]}  # for 0.2 ms steps


def _integrator(method: str) -> Any:
    kinds = import_module("mujoco").mjtIntegrator
    return {"semi_implicit_euler": kinds.mjINT_EULER, "rk4": kinds.mjINT_RK4}[method]


def spec_builder(
    rows: Sequence[Row], gravity: Any, step: float, method: str = "rk4", *, sites: bool = False
) -> Callable[[], Any]:
    """A function that builds the spec of a tree, without contacts and constraints.

    The hinges and slides of a joint share a body, as MuJoCo's users write it. `sites` adds each
    body's frame and its tip, named "body" and "body/tip".
    """
    mujoco = import_module("mujoco")
    prepared = _bodies(rows)
    off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT

    def build() -> Any:
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.compiler.boundmass = spec.compiler.boundinertia = 0
        spec.option.gravity = gravity
        spec.option.timestep, spec.option.integrator = step, _integrator(method)
        spec.option.disableflags |= off
        made = {-1: spec.worldbody}
        for row, parent, body, joints in prepared:
            made[row] = made[parent].add_body(**body)
            for joint in joints:
                made[row].add_joint(**joint)
        for i, row in enumerate(rows if sites else ()):
            if row.body is not None:
                home = matrix(row.body.rotation)
                quat, tip = _quaternion(home), home @ row.body.tip_point
                made[i].add_site(name=row.name, quat=quat)
                made[i].add_site(name=f"{row.name}/tip", pos=tip, quat=quat)
        return spec

    return build


def _bodies(rows: Sequence[Row]) -> list[tuple[int, int, dict[str, Any], list[dict[str, Any]]]]:
    """(row, parent row, arguments of add_body, of add_joint) of each MuJoCo body."""
    found = []
    joints: list[dict[str, Any]] = []
    first: Row | None = None  # first of the rows that share a body
    for i, row in enumerate(rows):
        first = first or row
        joints += _joints(row)
        follows = i + 1 < len(rows) and row.body is None and rows[i + 1].parent == i
        if follows and row.kind in PLAIN and rows[i + 1].kind in PLAIN:
            continue
        found.append((i, first.parent, _body(row, first), joints))
        joints, first = [], None
    return found


def _body(row: Row, first: Row) -> dict[str, Any]:
    mass, com, inertia = SPECK, np.zeros(3), SPECK * np.eye(3)
    if row.body is not None:
        mass, com, inertia = inertia_of(row.body)
    xx, yy, zz = np.diag(inertia)
    return {
        "name": row.name,
        "pos": first.shift,
        "quat": _quaternion(first.turn),
        "mass": mass,
        "ipos": com,
        "fullinertia": [xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]],
        "explicitinertial": True,
    }


def _joints(row: Row) -> list[dict[str, Any]]:
    """Return arguments of add_joint, three slides and a ball for a free body that is no root."""
    kinds = import_module("mujoco").mjtJoint
    if row.kind == PLACEHOLDER:
        return []
    if row.kind == "free" and row.parent < 0:
        return [{"name": row.name, "type": kinds.mjJNT_FREE, "armature": row.armature}]
    if row.kind == "free":
        slides = [{"type": kinds.mjJNT_SLIDE, "axis": axis} for axis in np.eye(3)]
        return [*slides, {"name": row.name, "type": kinds.mjJNT_BALL}]
    kind = {"rotate": kinds.mjJNT_HINGE, "translate": kinds.mjJNT_SLIDE, "ball": kinds.mjJNT_BALL}
    joint = {"name": row.name, "type": kind[row.kind], "armature": row.armature}
    return [joint if row.kind == "ball" else joint | {"axis": row.axis}]


def _quaternion(turn: Array) -> Array:
    return Rotation.from_matrix(turn).as_quat(scalar_first=True)


def coordinates(rows: Sequence[Row], q: Array, v: Array) -> tuple[Array, Array]:
    """MuJoCo's qpos, and T with qvel = T v: linear first, angular in body axes. T is orthogonal.

    A root's free joint has the position in the world, other free motions have three slides.
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
    order = walk(rows)
    return np.array(found)[order.q], T[order.v]


def ours(rows: Sequence[Row], qpos: Array) -> Array:
    """(n, nq) Pgraph's coordinates from MuJoCo's."""
    at, q = sizes(rows), np.empty_like(qpos)
    q[:, walk(rows).q] = qpos
    for i, row in enumerate(rows):
        if row.kind == "free" and row.parent < 0:
            q[:, at.q[i] : at.q[i] + 3] -= row.shift
    return q


# -- dynamics at a state ---------------------------------------------------------------------------


def _data(
    spec: Any, rows: Sequence[Row], state: State, *, at_rest: bool = False
) -> tuple[Any, Any, Array]:
    """(model, data in the state, T with qvel = T v)."""
    model = spec.compile()
    data = import_module("mujoco").MjData(model)
    data.qpos[:], T = coordinates(rows, state.q, state.v)
    data.qvel[:] = 0.0 if at_rest else T @ state.v
    data.qfrc_applied[:] = T @ state.tau  # T is orthogonal
    return model, data, T


def loaded(
    scene: Scene, step: float, method: str = "semi_implicit_euler"
) -> tuple[Any, Any, Array]:
    """(model, data in the scene's state, T with qvel = T v)."""
    spec = spec_builder(scene.rows, scene.model.gravity, step, method)()
    return _data(spec, scene.rows, scene.state)


def evaluate(state: State) -> dict[str, Array]:
    """M, C, v', the tip Jacobian and the poses of a state, in Pgraph's conventions."""
    mujoco = import_module("mujoco")
    rows = rows_of(state.model, state.topology)
    spec = spec_builder(rows, state.model.gravity, 1e-3, sites=True)()
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    model, data, T = _data(spec, rows, state)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    tips = [state.topology.names[k - 1] for k in state.topology.tips]
    sites = [data.site(name) for name in state.topology.names]

    def jacobian(site: str) -> Array:
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, linear, angular, model.site(site).id)
        return np.vstack((angular, linear))

    return {
        "mass_matrix": T.T @ M @ T,
        "bias_force": T.T @ data.qfrc_bias,
        "forward_dynamics": T.T @ data.qacc,
        "tip_jacobian": np.vstack([jacobian(f"{name}/tip") @ T for name in tips]),
        "position": np.array([site.xpos for site in sites]),
        "rotation": np.array([site.xmat.reshape(3, 3) for site in sites]),
    }


def rollout(
    scene: Scene, step: float, method: str, n: int, count: int = 1, threads: int = 0
) -> tuple[Callable[[], Array], Callable[[], Array]]:
    """(a function that takes n steps of `count` instances, one that gives the change of qpos)."""
    mujoco, rollouts = import_module("mujoco"), import_module("mujoco.rollout")
    model, data, _ = loaded(scene, step, method)
    data.qfrc_applied[:] = 0.0
    start = np.concatenate(([0.0], data.qpos, data.qvel))
    starts = np.repeat(start[None], count, axis=0)
    pool = rollouts.Rollout(nthread=threads if threads > 1 else 0)
    each = [mujoco.MjData(model) for _ in range(max(threads, 1))]
    out = np.empty((count, n, len(start)))

    def run() -> Array:
        pool.rollout(model, each, starts, nstep=n, state=out, skip_checks=False)
        return out

    def change() -> Array:
        moved = run()[:, -1, 1 : 1 + model.nq] - data.qpos
        found = np.empty_like(moved)
        found[:, walk(scene.rows).q] = moved
        return found

    return run, change


def stance(
    state: State, anchor: dict[str, Any] = SOFT, step: float = 1e-3, *, rk4: bool = False
) -> tuple[Any, Any]:
    """Return (model, data) with point constraints as `connect`, for RK4 if `rk4`."""
    mujoco = import_module("mujoco")
    rows = rows_of(state.model, state.topology)
    method = "rk4" if rk4 else "semi_implicit_euler"
    spec = spec_builder(rows, state.model.gravity, step, method)()
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    if rk4:
        spec.option.tolerance, spec.option.iterations = 0.0, 20
    for c in state.model.constraints:
        point = state.model.point_of(c)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=c.body,
            name2="world",
            data=[*point, *np.zeros(int(mujoco.mjNEQDATA) - 3)],
            **anchor,
        )
    model, data, _ = _data(spec, rows, state, at_rest=True)
    return model, data


def walker(model: Model, step: float, radius: float) -> Any:
    """A compiled model with MuJoCo's default contacts: balls of `radius` at the contact points.

    Contacts of bodies without points have their capsules and boxes. The ground is the plane through
    the origin whose normal is y.
    """
    mujoco = import_module("mujoco")
    rows = rows_of(model)
    spec = spec_builder(rows, model.gravity, step, "semi_implicit_euler")()
    spec.compiler.boundmass = spec.compiler.boundinertia = 0
    spec.option.disableflags = 0
    friction = [float(model.contacts[0].friction or 0.0), 0.005, 0.0001]
    turn = [np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0]
    plane, ball = mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_SPHERE
    spec.worldbody.add_geom(type=plane, size=[0, 0, 1], quat=turn, friction=friction, conaffinity=3)
    for c in model.contacts:
        for shape in () if c.points else model.body(c.body).touching:
            _add_solid(mujoco, spec.body(c.body), shape, friction)
    for c in model.contacts:
        if not c.points:
            continue
        x, y, z = c.points[0]
        place, size = (x, y + radius, z), [radius, 0, 0]
        body = spec.body(c.body)
        body.add_geom(type=ball, size=size, pos=place, friction=friction, condim=3)
    return spec.compile()


def _add_solid(mujoco: Any, body: Any, shape: Shape, friction: list[float]) -> None:
    """Add a shape that touches the ground alone."""
    found = kind_of(shape).mjcf(shape)
    assert found is not None, f"MuJoCo has no {shape.kind} like this"
    body.add_geom(
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{found[0].upper()}"),
        size=[*found[1], 0.0, 0.0][:3],
        pos=shape.position,
        quat=shape.rotation,
        friction=friction,
        condim=3,
        contype=2,
        conaffinity=0,
    )


# -- a motion --------------------------------------------------------------------------------------


class Run:
    """A motion, compiled once and run at any step."""

    by = "step"

    def __init__(self, motion: Exported):
        """Raises the exception of MuJoCo if it cannot compile the model."""
        self.mujoco = import_module("mujoco")
        self.motion = motion
        spec = spec_builder(motion.rows, motion.model.gravity, 1e-3)()
        bare = any(_without_inertia(row) for row in motion.rows)
        spec.compiler.boundinertia = LEAST_INERTIA if bare else 0
        for actuator in motion.actuators:
            self._actuate(spec, actuator)
        if motion.pins:
            self._pin(spec)
        self.model = spec.compile()
        self.data = self.mujoco.MjData(self.model)
        self.methods = {"rk4": self}

    def _actuate(self, spec: Any, actuator: Actuator) -> None:
        kinds = self.mujoco
        made = spec.add_actuator(
            target=self.motion.rows[actuator.row].name,
            trntype=kinds.mjtTrn.mjTRN_JOINT,
            dyntype=kinds.mjtDyn.mjDYN_INTEGRATOR,
            gaintype=kinds.mjtGain.mjGAIN_FIXED,
            biastype=kinds.mjtBias.mjBIAS_AFFINE,
        )
        made.gainprm[0] = 1.0
        made.biasprm[1], made.biasprm[2] = -actuator.kp, -actuator.kd

    def _pin(self, spec: Any) -> None:
        spec.option.disableflags &= ~int(self.mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        spec.option.jacobian = self.mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.tolerance = 1e-14
        for pin in self.motion.pins:
            rows = self.motion.rows
            other = spec.worldbody if pin.other < 0 else spec.body(rows[pin.other].name)
            place = other.add_site(name=f"{pin.name}:other", pos=pin.place)
            point = spec.body(rows[pin.row].name).add_site(name=f"{pin.name}:body", pos=pin.point)
            spec.add_equality(
                type=self.mujoco.mjtEq.mjEQ_CONNECT,
                objtype=self.mujoco.mjtObj.mjOBJ_SITE,
                name1=point.name,
                name2=place.name,
                solimp=[0.9999, 0.9999, 0.001, 0.5, 2],
            )

    def __call__(self, step: float, going: Callable[[], bool]) -> Trajectory | None:
        """Run RK4 at this step [s], or return None if `going` returned False."""
        motion, model, data = self.motion, self.model, self.data
        self.mujoco.mj_resetData(model, data)
        qpos, T = coordinates(motion.rows, motion.q, motion.v)
        data.qpos[:], data.qvel[:] = qpos, T @ motion.v
        data.act[:] = [np.interp(0.0, a.t, a.u) for a in motion.actuators]
        if model.neq:
            model.eq_solref[:, 0] = 2.0 * step  # the stiffest that the step permits
        stops = motion.knots
        counts = np.maximum(np.ceil(np.diff(stops) / step - 1e-9), 1).astype(int)
        rates = [np.diff(np.interp(stops, a.t, a.u)) / np.diff(stops) for a in motion.actuators]
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

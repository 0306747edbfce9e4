"""Pinocchio: a model, its dynamics at a state, and a motion by SciPy's DOP853 over its ABA."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from pgraph_core.rotation import matrix

from .motion import Clocks, Exported, Trajectory
from .rows import PLACEHOLDER, Array, Row, Scene, State, inertia_of, rows_of, sizes, walk

PROXIMAL = (1e-12, 1e-9, 20)  # accuracy, mu, iterations of its solver for pinned points
QUICK = (1e-10, 1e-6, 10)  # four iterations, to 1e-13 N
LINEAR_FIRST = [3, 4, 5, 0, 1, 2]


class Cancelled(Exception):
    """The run was cancelled."""


def build(model: Any, rows: Sequence[Row]) -> tuple[Any, dict[str, int], list[Any]]:
    """(Pinocchio's model, number of each named frame, (joint, pose in it) of each row)."""
    pin = import_module("pinocchio")
    out = pin.Model()
    out.gravity = pin.Motion(np.array(model.gravity), np.zeros(3))
    frame: dict[str, int] = {}
    place: list[Any] = [None] * len(rows)
    armature: list[float] = []
    for i in walk(rows).rows:
        row = rows[i]
        joint, offset = place[row.parent] if row.parent >= 0 else (0, pin.SE3.Identity())
        offset = offset * pin.SE3(row.turn, row.shift)
        if row.kind != PLACEHOLDER:
            joint = out.addJoint(joint, _joint(pin, row), offset, row.name)
            armature += [row.armature] * out.joints[joint].nv
            offset = pin.SE3.Identity()
        place[i] = joint, offset
        if row.body:
            out.appendBodyToJoint(joint, pin.Inertia(*inertia_of(row.body)), offset)
            home = offset * pin.SE3(matrix(row.body.rotation), np.zeros(3))
            tip = home * pin.SE3(np.eye(3), np.array(row.body.tip_point))
            for name, pose in ((row.name, home), (f"{row.name}/tip", tip)):
                frame[name] = out.addFrame(pin.Frame(name, joint, pose, pin.FrameType.OP_FRAME))
    out.armature = np.array(armature)
    return out, frame, place


def _joint(pin: Any, row: Row) -> Any:
    if row.kind == "rotate":
        return pin.JointModelRevoluteUnaligned(row.axis)
    if row.kind == "translate":
        return pin.JointModelPrismaticUnaligned(row.axis)
    return pin.JointModelSpherical() if row.kind == "ball" else pin.JointModelFreeFlyer()


def coordinates(rows: Sequence[Row], q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Pinocchio's q, and T, T'v with v_pin = T v: its balls and free flyers use body axes."""
    at = sizes(rows)
    found: list[float] = []
    T, Tdot_v = np.eye(len(v)), np.zeros(len(v))
    for i, row in enumerate(rows):
        ours, j = q[at.q[i] : at.q[i + 1]], at.v[i]
        if row.kind not in ("ball", "free"):
            found += list(ours)
            continue
        w, x, y, z = ours[-4:]
        found += [*ours[:-4], x, y, z, w]
        R = matrix(ours[-4:].tolist())
        if row.kind == "ball":
            T[j : j + 3, j : j + 3] = R.T
            continue
        T[j : j + 6, j : j + 6] = np.block([[np.zeros((3, 3)), R.T], [R.T, np.zeros((3, 3))]])
        angular, linear = R.T @ v[j : j + 3], R.T @ v[j + 3 : j + 6]
        Tdot_v[j : j + 3] = -np.cross(angular, linear)
    order = walk(rows)
    return np.array(found)[order.q], T[order.v], Tdot_v[order.v]


def ours(rows: Sequence[Row], q: Array) -> Array:
    """(n, nq) Pgraph's coordinates from Pinocchio's, whose quaternions end with w."""
    at, found = sizes(rows), np.empty_like(q)
    found[:, walk(rows).q] = q
    for i, row in enumerate(rows):
        if row.kind in ("ball", "free"):
            last = at.q[i + 1]
            turn = found[:, last - 4 : last]
            turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
            found[:, last - 4 : last] = turn[:, [3, 0, 1, 2]]
    return found


def pinned(
    model: Any, data: Any, points: Sequence[tuple[int, Any, tuple[Any, ...]]]
) -> tuple[Any, Any]:
    """(constraint models, their data) of points: joint, pose in it, joint and pose of the other.

    The other is () where the place is that of the start, in the world.
    """
    pin = import_module("pinocchio")
    made, found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    kind, axes = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for joint, here, other in points:
        made.append(pin.RigidConstraintModel(kind, model, joint, here, *other, axes))
        found.append(made[-1].createData())
    if points:
        pin.initConstraintDynamics(model, data, made, found)
    return made, found


# -- dynamics at a state ---------------------------------------------------------------------------


def evaluate(state: State) -> dict[str, Array]:
    """M, C, v', the tip Jacobian and the poses of a state, in Pgraph's conventions."""
    pin = import_module("pinocchio")
    rows = rows_of(state.model, state.topology)
    model, frame, _ = build(state.model, rows)
    data = model.createData()
    q, T, Tdot_v = coordinates(rows, state.q, state.v)
    v = T @ state.v
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    acceleration = pin.aba(model, data, q, v, np.linalg.solve(T.T, state.tau))
    tips = [state.topology.names[k - 1] for k in state.topology.tips]
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    jacobian = [
        pin.getFrameJacobian(model, data, frame[f"{name}/tip"], pin.LOCAL_WORLD_ALIGNED)
        for name in tips
    ]
    poses = [data.oMf[frame[name]] for name in state.topology.names]
    return {
        "mass_matrix": T.T @ M @ T,
        "bias_force": T.T @ pin.rnea(model, data, q, v, Tdot_v),
        "forward_dynamics": np.linalg.solve(T, acceleration - Tdot_v),
        "tip_jacobian": np.vstack([J.reshape(6, -1)[LINEAR_FIRST] @ T for J in jacobian]),
        "position": np.array([pose.translation for pose in poses]),
        "rotation": np.array([pose.rotation for pose in poses]),
    }


def forward_dynamics(scene: Scene) -> tuple[Callable[[], object], Array]:
    """(the call of ABA, v' in Pgraph's coordinates)."""
    pin = import_module("pinocchio")
    model, *_ = build(scene.model, scene.rows)
    data = model.createData()
    state = scene.state
    q, T, Tdot_v = coordinates(scene.rows, state.q, state.v)
    v, tau = T @ state.v, np.linalg.solve(T.T, state.tau)
    found = np.linalg.solve(T, pin.aba(model, data, q, v, tau) - Tdot_v)
    return lambda: pin.aba(model, data, q, v, tau), found


def derivatives(scene: Scene) -> tuple[Callable[[], object], Array]:
    """(the call, ∂v'/∂q, ∂v'/∂v and M⁻¹ stacked) of a tree of hinges."""
    pin = import_module("pinocchio")
    model, *_ = build(scene.model, scene.rows)
    data = model.createData()
    q, v, tau = scene.state.q, scene.state.v, scene.state.tau
    pin.computeABADerivatives(model, data, q, v, tau)
    upper = np.triu(data.Minv)
    found = np.stack((data.ddq_dq, data.ddq_dv, upper + np.triu(upper, 1).T))
    return lambda: pin.computeABADerivatives(model, data, q, v, tau), found


def builder(scene: Scene) -> Callable[[], object]:
    """A function that makes model and data from the rows."""
    return lambda: build(scene.model, scene.rows)[0].createData()


def constrained(
    state: State, settings: tuple[float, float, int] = QUICK
) -> tuple[Callable[..., Any], Callable[[], Any]]:
    """Accelerations with the model's point constraints, by Pinocchio's proximal solver.

    (a function of q, v and tau in Pinocchio's coordinates that returns v', one that returns the
    forces (n, 3) on the points [N], world axes).
    """
    pin = import_module("pinocchio")
    model, *_ = build(state.model, rows_of(state.model, state.topology))
    data = model.createData()
    points = [
        (model.getJointId(c.body), pin.SE3(np.eye(3), np.array(state.model.point_of(c))), ())
        for c in state.model.constraints
    ]
    made, found = pinned(model, data, points)
    chosen = pin.ProximalSettings(*settings)

    def acceleration(q: Array, v: Array, tau: Array) -> Array:
        return pin.constraintDynamics(model, data, q, v, tau, made, found, chosen)

    return acceleration, lambda: np.array([f.contact_force.linear for f in found])


def stance(state: State) -> tuple[Callable[[], object], Callable[[], Array]]:
    """(the call at a state, the contact forces (n, 3) [N] after it)."""
    rows = rows_of(state.model, state.topology)
    acceleration, forces = constrained(state)
    q, T, _ = coordinates(rows, state.q, state.v)
    v, tau = T @ state.v, np.linalg.solve(T.T, state.tau)
    return partial(acceleration, q, v, tau), forces


# -- a motion --------------------------------------------------------------------------------------


class Run:
    """A motion, built once and run by SciPy's DOP853 at any tolerance."""

    by = "rtol"

    def __init__(self, motion: Exported):
        pin = self.pin = import_module("pinocchio")
        self.motion = motion
        self.model, _, pose = build(motion.model, motion.rows)
        self.data = self.model.createData()
        at, order = sizes(motion.rows), walk(motion.rows)
        place_q, place_v = np.argsort(order.q), np.argsort(order.v)
        self.turning = [
            (int(place_q[at.q[i]]), int(place_v[at.v[i]]), motion.rows[i].kind)
            for i in order.rows
            if motion.rows[i].kind in ("ball", "free")
        ]
        points = []
        for each in motion.pins:
            joint, offset = pose[each.row]
            here = offset * pin.SE3(np.eye(3), each.point)
            other, frame = pose[each.other] if each.other >= 0 else (0, pin.SE3.Identity())
            there = frame * pin.SE3(np.eye(3), each.place)
            points.append((joint, here, (other, there)))
        self.pinned, self.found = pinned(self.model, self.data, points)
        self.settings = pin.ProximalSettings(*PROXIMAL)
        self.at_q = place_q[np.array([a.q for a in motion.actuators], dtype=int)]
        self.at_v = place_v[np.array([a.v for a in motion.actuators], dtype=int)]
        self.kp = np.array([a.kp for a in motion.actuators])
        self.kd = np.array([a.kd for a in motion.actuators])
        ways = ("dop853", "dop853 in pieces") if len(motion.bends) else ("dop853",)
        self.methods = {way: partial(self, way) for way in ways}

    def __call__(self, way: str, rtol: float, going: Callable[[], bool]) -> Trajectory | None:
        """One run to a tolerance, all at once or "in pieces" from bend to bend.

        None if `going` returned False.
        """
        from scipy.integrate import solve_ivp

        motion, evaluations = self.motion, 0
        q, T, _ = coordinates(motion.rows, motion.q, motion.v)
        y = np.concatenate((q, T @ motion.v))
        kept = [q[None]]
        ends = motion.t[-1:] if way == "dop853" else np.append(motion.bends, motion.t[-1])
        close = 1e-12 * motion.t[-1]  # frames and bends closer than this are one time
        start, rate, clocks = 0.0, self._rate(going), Clocks()
        try:
            for end in ends.tolist():
                here = (motion.t > start + close) & (motion.t <= end + close)
                wanted = np.minimum(motion.t[here], end)
                times = np.union1d(wanted, [end])
                done = solve_ivp(rate, (start, end), y, "DOP853", times, rtol=rtol, atol=rtol)
                if not done.success:
                    return None
                kept.append(done.y.T[np.isin(times, wanted), : self.model.nq])
                y, start, evaluations = done.y[:, -1], end, evaluations + done.nfev
        except Cancelled:
            return None
        seconds = clocks.read()
        found = ours(motion.rows, np.concatenate(kept))
        return Trajectory(found, seconds, {"evaluations": int(evaluations)})

    def _rate(self, going: Callable[[], bool]) -> Callable[..., Array]:
        """Return the function y', with u(t) of the actuators linear between all their knots."""
        pin, model, data, nq = self.pin, self.model, self.data, self.model.nq
        actuators, driven = self.motion.actuators, bool(self.motion.actuators)
        knots = np.unique(np.concatenate([[0.0, np.inf], *(a.t for a in actuators)]))[:-1]
        u = (
            np.array([np.interp(knots, a.t, a.u) for a in actuators])
            .reshape(len(actuators), len(knots))
            .T
        )
        slope = np.zeros_like(u)
        slope[:-1] = np.diff(u, axis=0) / np.diff(knots)[:, None]
        times = knots.tolist()
        at_q, at_v, kp, kd = self.at_q, self.at_v, self.kp, self.kd
        turning, made, found, settings = self.turning, self.pinned, self.found, self.settings
        tau, fixed = np.zeros(model.nv), len(made) > 0
        count = 0

        def rate(t: float, y: Array) -> Array:
            nonlocal count
            count += 1
            if count % 64 == 0 and not going():
                raise Cancelled
            q, v = y[:nq], y[nq:]
            if driven:
                k = bisect_right(times, t) - 1
                force = u[k] + (t - times[k]) * slope[k]
                tau[at_v] = force - kp * q[at_q] - kd * v[at_v]
            if turning:
                q = pin.normalize(model, q)
            if fixed:
                vdot = pin.constraintDynamics(model, data, q, v, tau, made, found, settings)
            else:
                vdot = pin.aba(model, data, q, v, tau)
            if not turning:
                return np.concatenate((v, vdot))
            return np.concatenate((_qdot(q, v, turning), vdot))

        return rate


def _qdot(q: Array, v: Array, turning: list[tuple[int, int, str]]) -> Array:
    """Return q' of Pinocchio's coordinates, with velocities in body axes."""
    parts, j = [], 0
    for at_q, at_v, kind in turning:
        parts.append(v[j:at_v])
        k = at_q
        if kind == "free":
            x, y, z, w = q[k + 3 : k + 7].tolist()
            a, b, c, p, r, s = v[at_v : at_v + 6].tolist()
            # R u = u + 2 w (e x u) + 2 e x (e x u)
            ex, ey, ez = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
            parts.append(
                (
                    a + w * ex + y * ez - z * ey,
                    b + w * ey + z * ex - x * ez,
                    c + w * ez + x * ey - y * ex,
                )
            )
            j = at_v + 6
        else:
            x, y, z, w = q[k : k + 4].tolist()
            p, r, s = v[at_v : at_v + 3].tolist()
            j = at_v + 3
        parts.append(
            (
                0.5 * (w * p + y * s - z * r),
                0.5 * (w * r + z * p - x * s),
                0.5 * (w * s + x * r - y * p),
                0.5 * (-x * p - y * r - z * s),
            )
        )
    parts.append(v[j:])
    return np.concatenate(parts)

"""A motion in Pinocchio, stepped by SciPy: accelerations in C++, steps in Python."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from ..rotation import matrix
from ..system import Array
from .elementary import PLACEHOLDER, Row, inertia_of, sizes
from .exported import Clocks, Exported, Trajectory

PROXIMAL = (1e-12, 1e-9, 20)  # accuracy, mu, iterations of its solver for points that hold


class Cancelled(Exception):
    """The run is not wanted any more."""


def build(model: Any, rows: list[Row]) -> tuple[Any, dict[str, int], list[Any]]:
    """(Pinocchio's model, number of each named frame, (joint, place in it) of each row)."""
    pin = import_module("pinocchio")
    out = pin.Model()
    out.gravity = pin.Motion(np.array(model.gravity), np.zeros(3))
    frame: dict[str, int] = {}
    place: list[Any] = []
    armature: list[float] = []
    for row in rows:
        joint, offset = place[row.parent] if row.parent >= 0 else (0, pin.SE3.Identity())
        offset = offset * pin.SE3(row.turn, row.shift)
        if row.kind != PLACEHOLDER:
            joint = out.addJoint(joint, _joint(pin, row), offset, row.name)
            armature += [row.armature] * out.joints[joint].nv
            offset = pin.SE3.Identity()
        place.append((joint, offset))
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


def coordinates(rows: list[Row], q: Array, v: Array) -> tuple[Array, Array, Array]:
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
    return np.array(found), T, Tdot_v


def ours(rows: list[Row], q: Array) -> Array:
    """(n, nq) our coordinates from Pinocchio's, whose quaternions end with w."""
    at, found = sizes(rows), q.copy()
    for i, row in enumerate(rows):
        if row.kind in ("ball", "free"):
            last = at.q[i + 1]
            turn = q[:, last - 4 : last]
            turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
            found[:, last - 4] = turn[:, 3]
            found[:, last - 3 : last] = turn[:, :3]
    return found


class Run:
    """A model of a motion, run again and again by SciPy's DOP853 at any tolerance."""

    def __init__(self, motion: Exported):
        """Built once."""
        self.pin = import_module("pinocchio")
        self.motion = motion
        self.model, _, self.place = build(motion.model, motion.rows)
        self.data = self.model.createData()
        self.turning = [
            (at_q, at_v, kind)
            for kind, at_q, at_v in zip(
                (row.kind for row in motion.rows), sizes(motion.rows).q, sizes(motion.rows).v
            )
            if kind in ("ball", "free")
        ]
        self._holds()
        drives = motion.drives
        self.at_q, self.at_v = (
            [int(x) for x in np.array([(d.q, d.v) for d in drives], dtype=int).reshape(-1, 2)[:, k]]
            for k in (0, 1)
        )
        self.kp, self.kd = (np.array([d[k] for d in drives]) for k in (3, 4))

    def _holds(self) -> None:
        """Its constraints of points that hold."""
        pin = self.pin
        self.held, self.found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for hold in self.motion.holds:
            joint, offset = self.place[hold.row]
            here = offset * pin.SE3(np.eye(3), hold.point)
            there = pin.SE3(np.eye(3), hold.place)
            kind, axes = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            self.held.append(
                pin.RigidConstraintModel(kind, self.model, joint, here, 0, there, axes)
            )
            self.found.append(self.held[-1].createData())
        if self.motion.holds:
            pin.initConstraintDynamics(self.model, self.data, self.held, self.found)
        self.settings = pin.ProximalSettings(*PROXIMAL)

    @property
    def ways(self) -> tuple[str, ...]:
        """How SciPy's DOP853 may go: over all at once, or anew where drives bend."""
        return ("dop853", "dop853 in pieces") if len(self.motion.bends) else ("dop853",)

    def __call__(self, way: str, rtol: float, going: Callable[[], bool]) -> Trajectory | None:
        """One run to a tolerance; None where `going` said no."""
        from scipy.integrate import solve_ivp

        motion, evaluations = self.motion, 0
        q, T, _ = coordinates(motion.rows, motion.q, motion.v)
        y = np.concatenate((q, T @ motion.v))
        kept = [q[None]]
        ends = motion.t[-1:] if way == "dop853" else np.append(motion.bends, motion.t[-1])
        close = 1e-12 * motion.t[-1]  # a frame and a bend that are meant to be one time
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
        """y'; drives are straight lines between all their knots."""
        pin, model, data, nq = self.pin, self.model, self.data, self.model.nq
        drives, driven = self.motion.drives, bool(self.motion.drives)
        knots = np.unique(np.concatenate([[0.0, np.inf], *(d.t for d in drives)]))[:-1]
        u = np.array([np.interp(knots, d.t, d.u) for d in drives]).reshape(len(drives), -1).T
        slope = np.zeros_like(u)
        slope[:-1] = np.diff(u, axis=0) / np.diff(knots)[:, None]
        times = knots.tolist()
        at_q, at_v, kp, kd = self.at_q, self.at_v, self.kp, self.kd
        turning, held, found, settings = self.turning, self.held, self.found, self.settings
        tau, fixed = np.zeros(model.nv), len(held) > 0
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
                vdot = pin.constraintDynamics(model, data, q, v, tau, held, found, settings)
            else:
                vdot = pin.aba(model, data, q, v, tau)
            if not turning:
                return np.concatenate((v, vdot))
            return np.concatenate((_qdot(q, v, turning), vdot))

        return rate


def _qdot(q: Array, v: Array, turning: list[tuple[int, int, str]]) -> Array:
    """q' of Pinocchio's coordinates; angular and linear velocities are in body axes."""
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

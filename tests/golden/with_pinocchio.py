"""A model and state evaluated by Pinocchio, in our conventions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pgraph_core.rotation import matrix

from .elementary import PLACEHOLDER, Row, inertia_of, rows_of, sizes

LINEAR_FIRST = [3, 4, 5, 0, 1, 2]


def evaluate(state) -> dict[str, np.ndarray]:
    """M, C, θ'', the tip Jacobian and the poses of `state` by Pinocchio."""
    rows = rows_of(state.model, state.topology)
    model, frame = build(state.model, rows)
    data = model.createData()
    q, T, Tdot_v = coordinates(rows, model, state)
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


def build(model, rows: list[Row]):
    """Pinocchio's model, and the number of each named frame."""
    out = pin.Model()
    out.gravity = pin.Motion(np.array(model.gravity), np.zeros(3))
    frame, place, armature = {}, [], []
    for row in rows:
        joint, offset = place[row.parent] if row.parent >= 0 else (0, pin.SE3.Identity())
        offset = offset * pin.SE3(row.turn, row.shift)
        if row.kind != PLACEHOLDER:
            joint = out.addJoint(joint, _joint(row), offset, row.name)
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
    return out, frame


def _joint(row: Row):
    if row.kind == "rotate":
        return pin.JointModelRevoluteUnaligned(row.axis)
    if row.kind == "translate":
        return pin.JointModelPrismaticUnaligned(row.axis)
    return pin.JointModelSpherical() if row.kind == "ball" else pin.JointModelFreeFlyer()


def coordinates(rows: list[Row], model, state):
    """Pinocchio's q, and T, T'v with v_pin = T v: its balls and free flyers use body axes."""
    at = sizes(rows)
    q, T, Tdot_v = [], np.eye(len(state.v)), np.zeros(len(state.v))
    for i, row in enumerate(rows):
        ours, j = state.q[at.q[i] : at.q[i + 1]], at.v[i]
        if row.kind not in ("ball", "free"):
            q += list(ours)
            continue
        w, x, y, z = ours[-4:]
        q += [*ours[:-4], x, y, z, w]
        R = matrix(ours[-4:])
        if row.kind == "ball":
            T[j : j + 3, j : j + 3] = R.T
            continue
        T[j : j + 6, j : j + 6] = np.block([[np.zeros((3, 3)), R.T], [R.T, np.zeros((3, 3))]])
        angular, linear = R.T @ state.v[j : j + 3], R.T @ state.v[j + 3 : j + 6]
        Tdot_v[j : j + 3] = -np.cross(angular, linear)
    return np.array(q), T, Tdot_v

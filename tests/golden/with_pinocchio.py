"""A model and state evaluated by Pinocchio, in our conventions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from pgraph_core.peers.elementary import rows_of
from pgraph_core.peers.in_pinocchio import build, coordinates

LINEAR_FIRST = [3, 4, 5, 0, 1, 2]


def evaluate(state) -> dict[str, np.ndarray]:
    """M, C, θ'', the tip Jacobian and the poses of `state` by Pinocchio."""
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

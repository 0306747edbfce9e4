"""A scene in Pinocchio."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from pgraph_core.peers import in_pinocchio as peer
from pgraph_core.peers.elementary import rows_of
from tests.core.trees import State

from .scenes import Scene


def forward_dynamics(scene: Scene) -> tuple[Callable[[], object], np.ndarray]:
    """(the call, v' in our coordinates)."""
    model, *_ = peer.build(scene.model, scene.rows)
    data = model.createData()
    state = scene.state
    q, T, Tdot_v = peer.coordinates(scene.rows, state.q, state.v)
    v, tau = T @ state.v, np.linalg.solve(T.T, state.tau)
    found = np.linalg.solve(T, pin.aba(model, data, q, v, tau) - Tdot_v)
    return lambda: pin.aba(model, data, q, v, tau), found


def derivatives(scene: Scene) -> tuple[Callable[[], object], np.ndarray]:
    """(the call, ∂v'/∂q, ∂v'/∂v and M⁻¹ stacked); of hinges, whose coordinates are ours."""
    model, *_ = peer.build(scene.model, scene.rows)
    data = model.createData()
    _, _, q, v, tau, *_ = scene.state
    pin.computeABADerivatives(model, data, q, v, tau)
    upper = np.triu(data.Minv)
    found = np.stack((data.ddq_dq, data.ddq_dv, upper + np.triu(upper, 1).T))
    return lambda: pin.computeABADerivatives(model, data, q, v, tau), found


def builder(scene: Scene) -> Callable[[], object]:
    """Model and data from rows that are at hand."""
    return lambda: peer.build(scene.model, scene.rows)[0].createData()


def stance(state: State) -> tuple[Callable[[], object], Callable[[], list]]:
    """(the call, the contact forces in world axes after it) of Pinocchio's proximal solver."""
    rows = rows_of(state.model, state.topology)
    model, *_ = peer.build(state.model, rows)
    data = model.createData()
    q, T, _ = peer.coordinates(rows, state.q, state.v)
    held, found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for c in state.model.constraints:
        place = pin.SE3(np.eye(3), np.array(c.point))
        joint, axes = model.getJointId(c.body), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        held.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joint, place, axes))
        found.append(held[-1].createData())
    pin.initConstraintDynamics(model, data, held, found)
    settings = pin.ProximalSettings(1e-10, 1e-6, 10)  # four iterations, to 1e-13 N
    v, tau = T @ state.v, np.linalg.solve(T.T, state.tau)

    def call() -> object:
        return pin.constraintDynamics(model, data, q, v, tau, held, found, settings)

    return call, lambda: [f.contact_force for f in found]

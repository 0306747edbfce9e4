"""Drake: a plant of revolute joints and a free root, and its dynamics at a state."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from .motion import Refused
from .rows import Array, Scene, inertia_of, sizes


def build(scene: Scene) -> tuple[Any, dict[str, Any]]:
    """(plant, its revolute joints by name)."""
    tree, math = import_module("pydrake.multibody.tree"), import_module("pydrake.math")
    plant = import_module("pydrake.multibody.plant").MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.array(scene.model.gravity))
    bodies: list[Any] = []
    joints: dict[str, Any] = {}
    for row in scene.rows:
        if row.body is None:
            raise Refused(f"it has a joint of several motions (row '{row.name}')")
        mass, com, inertia = inertia_of(row.body)
        unit = (inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))) / mass
        parts = (*np.diag(unit), unit[0, 1], unit[0, 2], unit[1, 2])
        spatial = tree.SpatialInertia(mass, com, tree.UnitInertia(*parts))
        bodies.append(plant.AddRigidBody(row.name, spatial))
        if row.kind == "free":
            continue
        parent = bodies[row.parent] if row.parent >= 0 else plant.world_body()
        place = math.RigidTransform(math.RotationMatrix(row.turn), row.shift)
        frame = plant.AddFrame(tree.FixedOffsetFrame(f"{row.name}.at", parent.body_frame(), place))
        joint = tree.RevoluteJoint(row.name, frame, bodies[-1].body_frame(), row.axis)
        joints[row.name] = plant.AddJoint(joint)
    plant.Finalize()
    return plant, joints


def forward_dynamics(scene: Scene) -> tuple[Callable[[], object], Array]:
    """Return a call that invalidates its cache, and v' in Pgraph's coordinates."""
    plant, joints = build(scene)
    context = plant.CreateDefaultContext()
    state, first = scene.state, sizes(scene.rows)
    q, v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
    tau, ours = np.zeros(len(v)), np.zeros(len(v), int)
    for i, row in enumerate(scene.rows):
        if row.kind == "free":
            place = state.q[first.q[i] : first.q[i + 1]]
            body = plant.GetBodyByName(row.name)
            at = body.floating_positions_start()
            q[at : at + 7] = [*place[3:], *(place[:3] + row.shift)]
            at = body.floating_velocities_start_in_v()
            ours[first.v[i] : first.v[i + 1]] = range(at, at + 6)
        else:
            q[joints[row.name].position_start()] = state.q[first.q[i]]
            ours[first.v[i]] = joints[row.name].velocity_start()
    v[ours], tau[ours] = state.v, state.tau
    plant.get_applied_generalized_force_input_port().FixValue(context, tau)

    given = np.concatenate((q, v))

    def call() -> Any:
        plant.SetPositionsAndVelocities(context, given)
        return plant.EvalTimeDerivatives(context)

    return call, call().get_generalized_velocity().CopyToVector()[ours]

"""The tree of the paper's Fig. 1, of rods, in Drake."""

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

ROWS = (
    ("1", "world"),
    ("2", "1"),
    ("3", "2"),
    ("4", "2"),
    ("5", "3"),
    ("6", "2"),
    ("7", "6"),
)


def build():
    plant = MultibodyPlant(0.0)
    bodies = {"world": plant.world_body()}
    for name, parent in ROWS:
        spatial = SpatialInertia.MakeFromCentralInertia(
            1, [0.1, 0, 0], RotationalInertia(2e-4, 3.4e-3, 3.4e-3)
        )
        body = bodies[name] = plant.AddRigidBody(name, spatial)
        link = [0.2, 0, 0] if parent != "world" else [0, 0, 0]
        place = FixedOffsetFrame(name + ".at", bodies[parent].body_frame(), RigidTransform(link))
        frame = plant.AddFrame(place)
        plant.AddJoint(RevoluteJoint(name, frame, body.body_frame(), [0, 1, 0]))
    plant.Finalize()
    return plant

"""The quadruped, in Drake."""

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

ROWS = (
    ("pelvis", "world", (0, 0.6487, 0), 7, (0.06, 0, 0), (0.04667, 0.05693, 0.05693, 0, 0, 0)),
    ("lumbar", "pelvis", (0.16, 0.02, 0), 5, (0.1, 0, 0), (0.027, 0.03017, 0.03017, 0, 0, 0)),
    ("thorax", "lumbar", (0.2, 0, 0), 5, (0.1, 0, 0), (0.03367, 0.03017, 0.03683, 0, 0, 0)),
    (
        "shoulder_neck_head",
        "thorax",
        (0.2, 0, 0),
        6,
        (0.11, 0.03, 0),
        (0.0442, 0.065, 0.0692, 0, 0, 0),
    ),
    (
        "left_humerus",
        "shoulder_neck_head",
        (0.14, -0.0966, -0.09),
        1.1,
        (-0.053, -0.0757, 0),
        (0.00356, 0.00219, 0.00488, -0.00188, 0, 0),
    ),
    (
        "left_radius",
        "left_humerus",
        (-0.1262, -0.1802, 0),
        0.8,
        (0.0378, -0.0935, 0),
        (0.00348, 0.00083, 0.004, 0.00128, 0, 0),
    ),
    (
        "left_front_paw",
        "left_radius",
        (0.0899, -0.2225, 0),
        0.3,
        (0.0074, -0.0847, 0),
        (0.00075, 7e-05, 0.00075, 6e-05, 0, 0),
    ),
    (
        "right_humerus",
        "shoulder_neck_head",
        (0.14, -0.0966, 0.09),
        1.1,
        (-0.053, -0.0757, 0),
        (0.00356, 0.00219, 0.00488, -0.00188, 0, 0),
    ),
    (
        "right_radius",
        "right_humerus",
        (-0.1262, -0.1802, 0),
        0.8,
        (0.0378, -0.0935, 0),
        (0.00348, 0.00083, 0.004, 0.00128, 0, 0),
    ),
    (
        "right_front_paw",
        "right_radius",
        (0.0899, -0.2225, 0),
        0.3,
        (0.0074, -0.0847, 0),
        (0.00075, 7e-05, 0.00075, 6e-05, 0, 0),
    ),
    (
        "left_femur",
        "pelvis",
        (0, -0.03, -0.08),
        1.5,
        (0.052, -0.0901, 0),
        (0.00751, 0.00375, 0.00939, 0.00325, 0, 0),
    ),
    (
        "left_tibia",
        "left_femur",
        (0.13, -0.2252, 0),
        0.9,
        (-0.0698, -0.0894, 0),
        (0.00371, 0.00245, 0.0057, -0.00254, 0, 0),
    ),
    (
        "left_hind_paw",
        "left_tibia",
        (-0.1662, -0.2128, 0),
        0.4,
        (0.0294, -0.0904, 0),
        (0.00114, 0.00021, 0.00125, 0.00034, 0, 0),
    ),
    (
        "right_femur",
        "pelvis",
        (0, -0.03, 0.08),
        1.5,
        (0.052, -0.0901, 0),
        (0.00751, 0.00375, 0.00939, 0.00325, 0, 0),
    ),
    (
        "right_tibia",
        "right_femur",
        (0.13, -0.2252, 0),
        0.9,
        (-0.0698, -0.0894, 0),
        (0.00371, 0.00245, 0.0057, -0.00254, 0, 0),
    ),
    (
        "right_hind_paw",
        "right_tibia",
        (-0.1662, -0.2128, 0),
        0.4,
        (0.0294, -0.0904, 0),
        (0.00114, 0.00021, 0.00125, 0.00034, 0, 0),
    ),
)


def build():
    plant = MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector([0, -9.81, 0])
    bodies = {"world": plant.world_body()}
    for name, parent, link, mass, com, inertia in ROWS:
        spatial = SpatialInertia.MakeFromCentralInertia(mass, com, RotationalInertia(*inertia))
        body = bodies[name] = plant.AddRigidBody(name, spatial)
        if parent == "world":
            continue
        place = FixedOffsetFrame(name + ".at", bodies[parent].body_frame(), RigidTransform(link))
        frame = plant.AddFrame(place)
        plant.AddJoint(RevoluteJoint(name, frame, body.body_frame(), [0, 0, 1]))
    plant.Finalize()
    return plant

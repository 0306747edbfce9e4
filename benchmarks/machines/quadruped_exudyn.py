"""The quadruped, in Exudyn."""

import exudyn as exu
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

Kind = exu.JointType
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
    root, *limbs = ROWS
    n = 6 + len(limbs)
    number = {name: 5 + i for i, (name, *_) in enumerate(ROWS)}
    free = [Kind.PrismaticX, Kind.PrismaticY, Kind.PrismaticZ]
    free += [Kind.RevoluteX, Kind.RevoluteY, Kind.RevoluteZ]
    none = [np.zeros(3)] * 5
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(
        NodeGenericODE2(
            referenceCoordinates=np.zeros(n),
            initialCoordinates=np.zeros(n),
            initialCoordinates_t=np.zeros(n),
            numberOfODE2Coordinates=n,
        )
    )
    tree = ObjectKinematicTree(
        nodeNumber=node,
        jointTypes=free + [Kind.RevoluteZ] * len(limbs),
        linkParents=[-1, 0, 1, 2, 3, 4, *(number[row[1]] for row in limbs)],
        jointTransformations=exu.Matrix3DList([np.eye(3)] * n),
        jointOffsets=exu.Vector3DList(
            [np.array(x) for x in (root[2], *none, *(row[2] for row in limbs))]
        ),
        linkInertiasCOM=exu.Matrix3DList([np.zeros((3, 3))] * 5 + [full(row[5]) for row in ROWS]),
        linkCOMs=exu.Vector3DList([np.array(x) for x in (*none, *(row[4] for row in ROWS))]),
        linkMasses=[0] * 5 + [row[3] for row in ROWS],
        gravity=[0, -9.81, 0],
    )
    mbs.AddObject(tree)
    mbs.Assemble()
    return container, mbs


def full(inertia):
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

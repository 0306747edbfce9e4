"""The tree of the paper's Fig. 1, of rods, in Exudyn."""

import exudyn as exu
import numpy as np
from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

Kind = exu.JointType
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
    n = len(ROWS)
    number = {"world": -1, **{name: i for i, (name, _) in enumerate(ROWS)}}
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
        jointTypes=[Kind.RevoluteY] * n,
        linkParents=[number[parent] for _, parent in ROWS],
        jointTransformations=exu.Matrix3DList([np.eye(3)] * n),
        jointOffsets=exu.Vector3DList([[0, 0, 0], *[[0.2, 0, 0]] * (n - 1)]),
        linkInertiasCOM=exu.Matrix3DList([np.diag([2e-4, 3.4e-3, 3.4e-3])] * n),
        linkCOMs=exu.Vector3DList([[0.1, 0, 0]] * n),
        linkMasses=[1] * n,
        gravity=[0, 0, -9.81],
    )
    mbs.AddObject(tree)
    mbs.Assemble()
    return container, mbs

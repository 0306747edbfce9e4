"""Signed distances against MuJoCo's numbers, read from a file."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pgraph_core import shapes as solids

from ..core.touching import Scene, pose

NUMBERS = np.load(Path(__file__).parent / "contacts.npz")
KINDS = ("sphere", "capsule", "box", "cylinder", "hull")
ROUNDING = 1e-13
FLOAT32 = 2e-7  # MuJoCo keeps a mesh's vertices so
ITERATED = 3e-12  # MuJoCo's distances of cylinders are iterated


def solid(kind, size, points):
    """A shape of MuJoCo's sizes."""
    match KINDS[kind]:
        case "sphere":
            return solids.sphere(size[0])
        case "capsule":
            return solids.capsule(size[0], 2 * size[1])
        case "box":
            return solids.box(2 * size)
        case "cylinder":
            return solids.cylinder(size[0], 2 * size[1])
        case _:
            return solids.hull(points)


def case(n):
    """The scene of a case, the kinds of its shapes, and their radii."""
    pair, sizes = NUMBERS["pairs"][n], NUMBERS["sizes"][n]
    shapes = [solid(*given) for given in zip(pair, sizes, NUMBERS["points"][n])]
    turns = [Rotation.from_quat(p[3:], scalar_first=True) for p in NUMBERS["poses"][n]]
    poses = [pose(p[:3], turn) for p, turn in zip(NUMBERS["poses"][n], turns)]
    return Scene(shapes, poses), [KINDS[k] for k in pair], sizes[:, 0]


@pytest.mark.parametrize("kind", KINDS)
def test_distance_equals_golden(kind):
    """MuJoCo's measure differs if a capsule's line is inside a box."""
    cases = np.flatnonzero(NUMBERS["pairs"][:, 0] == KINDS.index(kind))
    for n in cases:
        scene, kinds, radii = case(n)
        gap, expected = scene.gap(), NUMBERS["distance"][n]
        if set(kinds) == {"capsule", "box"} and gap < -radii[kinds.index("capsule")]:
            continue
        slack = FLOAT32 if "hull" in kinds else ITERATED if "cylinder" in kinds else ROUNDING
        assert abs(gap - expected) <= slack


def test_gap_from_the_ground_equals_golden():
    for n in range(len(NUMBERS["pairs"])):
        scene, kinds, _ = case(n)
        slack = [FLOAT32 if kind == "hull" else ROUNDING for kind in kinds]
        assert (np.abs(scene.gaps(on_ground=[0, 1]) - NUMBERS["ground"][n]) <= slack).all()

"""Shapes with poses, and their gaps and contact points by the contact kernels."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pgraph_core import shapes as solids
from pgraph_core.contact import packed_shapes
from pgraph_core.contact.packed_shapes import Placed
from pgraph_core.engine.arrays import Candidates
from pgraph_core.engine.contact import search as kernels
from pgraph_core.engine.records import (
    APART,
    CAPSULE,
    CONTACT,
    GROUND_PAIR,
    MEMBER,
    POSE,
    SHAPE_PAIR,
    SPHERE,
    rows_of,
    table,
)
from pgraph_core.shapes import Solid

FLAT = packed_shapes.ground((0, 0, 1))
NO_PAIRS, NOBODY = rows_of(SHAPE_PAIR, ()), rows_of(MEMBER, ())
NO_GROUND, NOT_APART = rows_of(GROUND_PAIR, ()), rows_of(APART, ())
KINDS = ("sphere", "capsule", "box", "hull")  # balls about vertices, and solids with corners
CURVED = ("cylinder", "ellipsoid")


class Touch(NamedTuple):
    """Contact points: on A, on B, normal from B to A, gap, (shape A, shape B, feature, contact)."""

    a: np.ndarray
    b: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    whose: np.ndarray


class Scene:
    """Solids with poses (n, 12), each on a row and body of its own, from 1."""

    def __init__(self, shapes: Sequence[Solid], poses: np.ndarray | None = None, ground=FLAT):
        self.shapes = list(shapes)
        self.geometry = packed_shapes.packed(
            [Placed(s, i, i) for i, s in enumerate(shapes, start=1)]
        )
        self.poses = np.array([pose()] * len(self.shapes)) if poses is None else np.array(poses)
        self.ground = ground

    def ask(self, touch, margin: float = 1e3, room: int = 20000) -> Touch:
        """Contact points of a `touch` table of the kernels."""
        search = packed_shapes.search_space(self.geometry, len(touch.members))
        out, poses = table(CONTACT, room), as_poses(self.poses)
        n = kernels.contacts(self.geometry, self.ground, touch, poses, search, margin, out)
        assert n <= room
        whose = np.column_stack([out[:n][x] for x in ("shape_a", "shape_b", "feature", "pair")])
        return Touch(*(out[:n][x] for x in ("point_a", "point_b", "normal", "gap")), whose)

    def pair(self, i: int = 0, j: int = 1, margin: float = 1e3) -> Touch:
        """Contact points of two shapes."""
        pairs = rows_of(SHAPE_PAIR, [(i, j, 0)])
        return self.ask(Candidates(NO_GROUND, pairs, NOBODY, NOT_APART), margin)

    def on_ground(self, i: int = 0, margin: float = 1e3) -> Touch:
        """Contact points of a shape with the ground."""
        ground = rows_of(GROUND_PAIR, [(i, 0)])
        return self.ask(Candidates(ground, NO_PAIRS, NOBODY, NOT_APART), margin)

    def among(self, members, apart=(), margin: float = 0.0) -> Touch:
        """Contact points of every two members: (shape, contact) each."""
        crowd, joined = rows_of(MEMBER, members), rows_of(APART, apart)
        return self.ask(Candidates(NO_GROUND, NO_PAIRS, crowd, joined), margin)

    def gaps(self, on_ground=(), pairs=()) -> np.ndarray:
        """Signed distances from the ground and of pairs."""
        ground = rows_of(GROUND_PAIR, [(i, 0) for i in on_ground])
        both = rows_of(SHAPE_PAIR, [(i, j, 0) for i, j in pairs])
        found = np.zeros(len(ground) + len(both))
        room = packed_shapes.search_space(self.geometry, 0).room
        touch, poses = Candidates(ground, both, NOBODY, NOT_APART), as_poses(self.poses)
        kernels.gaps(self.geometry, self.ground, touch, poses, room, table(CONTACT, 8), found)
        return found

    def gap(self, i: int = 0, j: int = 1) -> float:
        """Signed distance of two shapes."""
        return float(self.gaps(pairs=[(i, j)])[0])

    def placed(self, i: int) -> np.ndarray:
        """Vertices of shape i in the world (without its radius)."""
        return self.shapes[i].vertices @ self.poses[i, 3:].reshape(3, 3).T + self.poses[i, :3]


def as_poses(poses: np.ndarray):
    """Poses (n, 12) as records."""
    return rows_of(POSE, [(x[:3], x[3:]) for x in poses])


def pose(position=(0.0, 0.0, 0.0), rotation: Rotation | None = None) -> np.ndarray:
    """Position and rotation, as the kernels have them."""
    matrix = np.eye(3) if rotation is None else rotation.as_matrix()
    return np.concatenate((position, matrix.ravel()))


def random_solid(rng: np.random.Generator, kind: str, size: float = 1.0) -> Solid:
    """Return a random solid of about `size`."""
    x = size * rng.uniform(0.1, 0.5, 3)
    match kind:
        case "sphere":
            return solids.sphere(x[0])
        case "capsule":
            return solids.capsule(x[0] / 2, 2 * x[1])
        case "box":
            return solids.box(2 * x)
        case "cylinder":
            return solids.cylinder(x[0], 2 * x[1])
        case "ellipsoid":
            return solids.ellipsoid(x.tolist())
        case "points":
            return solids.points(rng.normal(size=(3, 3)) * x)
        case _:
            return solids.hull(rng.normal(size=(rng.integers(4, 20), 3)) * x)


def random_pose(rng: np.random.Generator, spread: float, *, square: bool = False) -> np.ndarray:
    """A random pose. With `square`, on a grid and at right angles, so that faces are parallel."""
    place = rng.normal(size=3) * spread
    if square:
        turn = Rotation.from_euler("xyz", rng.integers(0, 4, 3) * (np.pi / 2))
        exact = np.round(turn.as_matrix())
        return np.concatenate((np.round(place * 8 / spread) / 8 * spread, exact.ravel()))
    return pose(place, Rotation.random(rng=rng))


def moved(poses: np.ndarray, position, rotation: Rotation) -> np.ndarray:
    """Poses after a rigid motion of everything."""
    r = rotation.as_matrix()
    out = poses.copy()
    out[:, :3] = poses[:, :3] @ r.T + position
    out[:, 3:] = (r @ poses[:, 3:].reshape(-1, 3, 3)).reshape(-1, 9)
    return out


def rounded(solid: Solid) -> float:
    """The radius of spheres and capsules, else 0."""
    return solid.radius if solid.kind in (SPHERE, CAPSULE) else 0.0

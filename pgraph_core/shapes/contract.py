"""The contract of a kind of shape: what its file answers about a shape, and about a drawn piece.

A shape is any object with the fields of `pg.Shape`. Answers are in the frame of the shape, along
whose z axis capsules and cylinders lie.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..errors import needed
from .rays import Hit, Ray, triangle_hits
from .solid import Array, Solid

Size = tuple[float, float, float]
Color = tuple[int, int, int]
Mark = tuple[Array, str, bool]  # a point, its name, and whether it is inside
Volume = tuple[float, Array, Array]  # volume [m³], centre (3,), inertia (3, 3) about it


@dataclass(frozen=True)
class Piece:
    """A drawn solid in body axes. The box of a solid of a primitive kind is `size`."""

    kind: str
    size: Size  # [m], or the scale of a mesh
    position: Size  # its middle [m]
    rotation: np.ndarray  # (3, 3)
    file: Any = ""  # file of a mesh, or the shape of another surface
    color: Color | None = None  # its own colour, or None for that of its body
    opacity: float = 1.0
    taper: float = 1.0  # ratio of the far to the near radius of a capsule or cylinder


class Form(NamedTuple):
    """The drawing of a shape: the fields of a `Piece` that depend on its kind alone."""

    kind: str
    size: Size = (1.0, 1.0, 1.0)
    file: Any = ""
    taper: float = 1.0
    offset: float = 0.0  # z of its middle [m]


class Element(NamedTuple):
    """An element of a URDF file, at a height along z [m]."""

    tag: str
    attributes: Mapping[str, Any]
    height: float = 0.0


class Kind(ABC):
    """A kind of shape. A kind gives the abstract answers, and others that differ from those here.

    By default a shape is symmetric about its coordinate planes, and files of other programs have no
    element for it.
    """

    name: str
    needs: tuple[str, ...] = ()  # the fields that say how large it is
    may: tuple[str, ...] = ()  # fields that change its size besides
    cells: tuple[str, ...] = ()  # the numbers that tell its size, if not all that it needs
    edged = False  # its size is given along three axes
    rolls = ""  # "sphere" or "disc": what it is for a rolling constraint
    elsewhere = ""  # source of its shapes, if edges typed on the page do not make them
    attributes: tuple[str, ...] = ()  # the attributes of its element in URDF

    @property
    def one(self) -> str:
        """The kind with its article."""
        return f"an {self.name}" if self.name[0] in "aeiou" else f"a {self.name}"

    # -- the description -------------------------------------------------------------------------

    def read(self, data: Any) -> Any:
        """Return the fields of a shape, which may be given as other programs give them."""
        return data

    def problems(self, shape: Any) -> list[str]:
        """Return problems of fields together."""
        return []

    def optional(self, shape: Any) -> tuple[str, ...]:
        """Return the fields among `may` that this shape may have."""
        return self.may

    def edges(self, shape: Any) -> Size | None:
        """Return the edges of the shape's box [m], or None if they are not among its fields."""
        return None

    def half_turn(self, shape: Any, plane: int) -> int | None:
        """Return the axis of half a turn that is part of its mirror image, or None.

        The mirror is normal to axis `plane`. By default a shape is its own image.
        """
        return None

    def mirrored(self, shape: Any, plane: int) -> dict[str, Any]:
        """Return the fields of its size that the mirror changes, before the half turn."""
        return {}

    # -- geometry --------------------------------------------------------------------------------

    @abstractmethod
    def volume(self, shape: Any, unit: str = "m") -> Volume:
        """Return its volume, centre, and inertia about it at density 1.

        `unit` is that of its file. Raises ModelError, FileError.
        """

    @abstractmethod
    def corners(self, shape: Any) -> Array:
        """Return points (n, 3) whose bounding box encloses the shape tightly [m]."""

    @abstractmethod
    def solids(self, shape: Any) -> tuple[Solid, ...]:
        """Return the solids by which it touches. Raises FileError, ModelError, MissingPackage."""

    def excess(self, shape: Any) -> float:
        """Return the volume of what touches over that of the shape, if nobody asked for more."""
        return 1.0

    # -- files of other programs -----------------------------------------------------------------

    def urdf(self, shape: Any, drawn: bool) -> Sequence[Element]:
        """Return its elements in URDF, drawn or for contact, or none if URDF has no such shape."""
        return ()

    def mjcf(self, shape: Any) -> tuple[str, Sequence[float]] | None:
        """Return (type, size) of its geom in MJCF, or None if MuJoCo has no such shape."""
        return None

    # -- pictures --------------------------------------------------------------------------------

    def form(self, shape: Any) -> Form:
        """Return what it is drawn as."""
        return Form(self.name, file=shape)


class Sized(Kind):
    """A kind of shape whose sizes follow from the edges of its box."""

    @abstractmethod
    def fitted(self, edges: Sequence[float]) -> dict[str, Any]:
        """Return the fields `needs` of a shape that fills about a box with these edges [m]."""

    @abstractmethod
    def edges(self, shape: Any) -> Size: ...

    def corners(self, shape: Any) -> Array:
        return around(np.array(self.edges(shape)) / 2)


class Geom(ABC):
    """A kind of shape that is a geom of MuJoCo."""

    geom: int  # number of its type

    @abstractmethod
    def of_mjcf(self, x: float, y: float, z: float) -> dict[str, Any]:
        """Return the fields `needs` of a geom of this size."""


class Picture(ABC):
    """A kind of drawn piece."""

    faceted = True  # drawn as triangles
    tall = 1.0  # height of the unit solid that many pieces share

    @abstractmethod
    def drawn(self, piece: Piece, many: bool = False) -> Any:
        """Return a trimesh in the axes of the piece, with fewer faces for one of `many`."""

    @abstractmethod
    def bounds(self, piece: Piece) -> Array:
        """Return the minimum and maximum corners of a piece along its own axes [m], (2, 3)."""

    def outline(self, piece: Piece) -> Array:
        """Return points (n, 3) in its axes whose convex hull is the piece or its box [m]."""
        low, high = self.bounds(piece)
        return np.where(np.array([*itertools.product((0, 1), repeat=3)]), high, low)

    def marks(self, piece: Piece) -> Iterator[Mark]:
        """Yield points of a piece in its axes that a pointer takes."""
        yield self.bounds(piece).mean(axis=0), "centre", True

    def meetings(self, piece: Piece, ray: Ray) -> Iterator[Hit]:
        """Yield surface points of a piece in front of the camera, all in the axes of the piece."""
        solid = self.drawn(piece)
        return triangle_hits(np.asarray(solid.vertices)[np.asarray(solid.faces)], ray)


class Surface(Kind, Picture):
    """A kind of shape that is measured and drawn by its closed surface."""

    @abstractmethod
    def surface(self, shape: Any) -> tuple[Array, Array]:
        """Return (vertices (n, 3), triangles (m, 3)) of its closed surface [m]."""

    def volume(self, shape: Any, unit: str = "m") -> Volume:
        return enclosed(*self.surface(shape))

    def corners(self, shape: Any) -> Array:
        return self.surface(shape)[0]

    def drawn(self, piece: Piece, many: bool = False) -> Any:
        vertices, faces = self.surface(piece.file)
        return needed("trimesh").Trimesh(vertices, faces, process=False)

    def bounds(self, piece: Piece) -> Array:
        corners = self.corners(piece.file)
        return np.stack((corners.min(axis=0), corners.max(axis=0)))


class Primitive(Sized, Picture):
    """A kind of shape that is drawn as a solid of its own, scaled to the size of the piece."""

    faceted = False

    @abstractmethod
    def primitive(self, size: Size, taper: float, many: bool) -> Any:
        """Return a trimesh centred at the origin."""

    def drawn(self, piece: Piece, many: bool = False) -> Any:
        return _primitive(self, piece.size, piece.taper, many).copy()

    def bounds(self, piece: Piece) -> Array:
        wider = max(piece.taper, 1.0)
        half = np.asarray(piece.size) / 2 * (wider, wider, 1.0)
        return np.stack((-half, half))


@lru_cache(maxsize=256)
def _primitive(kind: Primitive, size: Size, taper: float, many: bool) -> Any:
    return kind.primitive(size, taper, many)


def around(half: Array) -> Array:
    """Return the corners (8, 3) of a box about the origin."""
    return half * np.array([*itertools.product((-1, 1), repeat=3)])


def enclosed(vertices: Array, faces: Array) -> Volume:
    """Return the volume of a closed surface, using tetrahedra from the origin [Tonon 2004]."""
    p = vertices[faces]
    volumes = np.linalg.det(p) / 6
    volume = volumes.sum()
    middle = volumes @ p.sum(axis=1) / (4 * volume)
    sums = p.sum(axis=1)
    each = np.einsum("kai,kaj->kij", p, p) + np.einsum("ki,kj->kij", sums, sums)
    second = np.einsum("k,kij->ij", volumes, each) / 20 - volume * np.outer(middle, middle)
    return float(volume), middle, np.trace(second) * np.eye(3) - second

"""Kinds of shapes, one file each.

A new kind is a file beside `boxes` with its subclass of `Kind`, its name in `ShapeKind` and its
entry of `KINDS`.
"""

from typing import Any, Literal

from .boxes import Box
from .boxes import box as box
from .capsules import Capsule
from .capsules import capsule as capsule
from .contract import Geom as Geom
from .contract import Kind, Picture
from .contract import Sized as Sized
from .cylinders import Cylinder
from .cylinders import cylinder as cylinder
from .ellipsoids import Ellipsoid
from .ellipsoids import ellipsoid as ellipsoid
from .heightfields import Heightfield
from .heightfields import heightfield as heightfield
from .hulls import hull as hull
from .meshes import Mesh
from .meshes import convex_hull as convex_hull
from .solid import Solid as Solid
from .solid import edges_of as edges_of
from .solid import points as points
from .spheres import Sphere
from .spheres import sphere as sphere

ShapeKind = Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "mesh", "heightfield"]
KINDS: dict[str, Kind] = {
    one.name: one
    for one in (Box(), Sphere(), Ellipsoid(), Cylinder(), Capsule(), Mesh(), Heightfield())
}
PICTURES = {name: one for name, one in KINDS.items() if isinstance(one, Picture)}
SIZES = tuple(sorted({name for kind in KINDS.values() for name in (*kind.needs, *kind.may)}))


def kind_of(shape: Any) -> Kind:
    """Return the kind of a shape."""
    return KINDS[shape.kind]


def picture_of(piece: Any) -> Picture:
    """Return the kind of a drawn piece."""
    return PICTURES[piece.kind]

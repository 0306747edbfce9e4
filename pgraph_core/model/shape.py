"""Body shapes, and the mass properties of homogeneous bodies with these shapes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, model_validator

from ..errors import ModelError, Problem, shown
from ..fields import (
    Finite,
    Frozen,
    Number,
    Quat,
    Row3,
    Text,
    Vec3,
    field,
    listed,
    maybe_vector,
    quaternion,
    refuse,
    vector,
)
from ..mesh_files import load_mesh
from ..rotation import matrix
from ..units import NONE, RAD, M, S

Array = np.ndarray


HEX = re.compile("#[0-9a-fA-F]{6}")


def _colour(value: Any) -> Any:
    """Convert '#rrggbb' to three numbers from 0 to 1."""
    if isinstance(value, str) and HEX.fullmatch(value):
        return tuple(int(value[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return listed(value)


Colour = Annotated[Row3, BeforeValidator(_colour)]


_colour_in: Callable[[npt.ArrayLike | None], Colour | None] = _colour
_scale_in: Callable[[npt.ArrayLike], Number | Vec3] = listed
Heights = Annotated[tuple[tuple[Finite, ...], ...], BeforeValidator(listed)]


_heights_in: Callable[[npt.ArrayLike | None], Heights | None] = listed


class Shape(Frozen):
    """A solid in the body's frame [m], which may be drawn, collide with others, or both."""

    kind: Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "mesh", "heightfield"] = (
        field("one of box, sphere, ellipsoid, cylinder, capsule, mesh, heightfield")
    )
    size: Vec3 | None = field(
        "the three edge lengths of a box [m]; of a heightfield along x and y, and how far its "
        "solid reaches below its lowest height",
        converter=maybe_vector, default=None, label="Edges", dim=M,
    )  # fmt: skip
    radius: Number | None = field("a radius > 0 [m]", default=None, gt=0, dim=M)
    radii: Vec3 | None = field(
        "the three half axes of an ellipsoid [m]",
        converter=maybe_vector, default=None, label="Half axes", dim=M,
    )  # fmt: skip
    heights: Heights | None = field(
        "rows of heights of a heightfield [m], finite numbers, all rows equally long: "
        "heights[i][j] is at place i along x and j along y",
        converter=_heights_in, default=None, dim=M,
    )  # fmt: skip
    length: Number | None = field(
        "a length > 0 along z [m], a capsule's without its caps",
        default=None, gt=0, dim=M,
    )  # fmt: skip
    end_radius: Number | None = field(
        "a radius >= 0 [m] at the far end (+z) of a cylinder, 0 for a cone, or of a capsule that "
        "is only drawn",
        default=None, ge=0, dim=M, help="radius at the far end, if tapered",
    )  # fmt: skip
    file: Text | None = field("the name of a mesh file", default=None)
    scale: Number | Vec3 = field(
        "a scale factor > 0 of the mesh, or three nonzero factors, one per axis",
        converter=_scale_in, default=1.0, dim=NONE,
    )  # fmt: skip
    hull: Literal["convex", "parts"] | None = field(
        "'convex': a mesh touches by its convex hull, closed or not; 'parts': by several convex "
        "parts that together are about the mesh",
        default=None,
    )  # fmt: skip
    position: Vec3 = field(
        "three finite numbers [x, y, z] [m]",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M, role="point",
    )  # fmt: skip
    rotation: Quat = field(
        "a quaternion [w, x, y, z]",
        converter=quaternion, default=(1.0, 0.0, 0.0, 0.0), label="Orientation", role="frame",
    )  # fmt: skip

    role: Literal["visual", "collision", "both"] = field(
        "'visual': drawn, 'collision': touches, or 'both'",
        default="both",
        since=2,
        help="use of the shape",
    )
    colour: Colour | None = field(
        "three numbers [red, green, blue] from 0 to 1, or '#rrggbb'",
        converter=_colour_in, default=None, dim=NONE, since=2,
        help="#rrggbb; default: the colour of the branch",
    )  # fmt: skip
    opacity: Number = field(
        "a number from 0 to 1", default=1.0, dim=NONE, since=2, ge=0, le=1,
        help="from 0 (invisible) to 1 (opaque)",
    )  # fmt: skip
    surface_velocity: Vec3 = field(
        "three finite numbers [m/s], in the axes of the shape: velocity of its surface relative to "
        "the body",
        converter=vector, default=(0.0, 0.0, 0.0), dim=M / S, role="vector", since=7,
        label="Surface",
        help="surface velocity relative to the body, for example of a belt",
    )  # fmt: skip
    surface_spin: Vec3 = field(
        "three finite numbers [rad/s], in the axes of the shape: spin of its surface relative to "
        "the body, about the origin of the shape",
        converter=vector, default=(0.0, 0.0, 0.0), dim=RAD / S, role="axial", since=7,
        label="Spin",
        help="surface rotation about the shape origin, for example of a turntable",
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _of_its_kind(cls, data: Any) -> Any:
        """Reject dimensions that belong to other kinds before checking their values."""
        kind = data.get("kind") if type(data) is dict or isinstance(data, Mapping) else None
        size: Any = data.get("size") if kind == "sphere" else None
        if size is not None and np.size(size) == 1:
            data = {**data, "radius": np.ravel(size)[0], "size": None}  # MuJoCo's size of a sphere
        if (
            isinstance(kind, str)
            and kind in DIMENSIONS
            and not data.keys().isdisjoint(FOREIGN[kind])
        ):
            one, own = _one(kind), " and ".join(DIMENSIONS[kind])
            refuse([
                ("shape", f"{one} has no {name}: give {own}{_doubled(kind, name, data[name])}, "
                f"got {name} {shown(data[name])}")
                for name in FOREIGN[kind]
                if data.get(name) is not None
            ])  # fmt: skip
        return data

    @model_validator(mode="after")
    def _complete(self) -> Self:
        own = vars(self)  # faster than descriptors for thousands of shapes
        problems = [
            (name, f"{_one(self.kind)} needs {name}")
            for name in DIMENSIONS[own["kind"]]
            if own[name] is None
        ]
        size, radii, scale, colour = own["size"], own["radii"], own["scale"], own["colour"]
        if size is not None and min(size) <= 0:
            text = f"a {self.kind}'s edges must be > 0 [m], got {shown(size)}"
            problems.append(("shape", text))
        if radii is not None and min(radii) <= 0:
            text = f"the radii of an ellipsoid must be > 0 [m], got {shown(radii)}"
            problems.append(("shape", text))
        if self.heights is not None:
            lengths = {len(row) for row in self.heights}
            if len(lengths) != 1 or len(self.heights) < 2 or min(lengths) < 2:
                found = " and ".join(map(str, sorted(lengths)[:3])) or "0"
                text = "heights must be at least two rows of at least two numbers, equally long"
                given = f"{len(self.heights)} rows of {found}"
                problems.append(("shape", f"{text}, without holes, got {given}"))
        if not (all(scale) if isinstance(scale, tuple) else scale > 0):
            text = f"scale must be > 0, or three factors that are not 0, got {shown(scale)}"
            problems.append(("shape", text))
        if self.end_radius is not None:
            problems += self._tapered()
        if not 0.5 < math.hypot(*own["rotation"]) < 2:
            given = shown(self.rotation)
            problems.append(("shape", f"rotation must be a unit quaternion, got {given}"))
        if colour is not None and not 0 <= min(colour) <= max(colour) <= 1:
            given = shown(colour)
            problems.append(("shape", f"colour must be from 0 to 1, got {given}"))
        refuse(problems)
        return self

    @property
    def moves(self) -> bool:
        """True if the surface moves relative to the body."""
        return any(self.surface_velocity) or any(self.surface_spin)

    def _tapered(self) -> list[tuple[str, str]]:
        """Return problems with a tapered shape."""
        if self.kind == "capsule" and self.role != "visual":
            text = "a capsule that tapers is only drawn; give role 'visual'"
            return [("shape", f"{text}, got end_radius {self.end_radius:g}")]
        if self.kind == "capsule" and self.radius is not None and self.length is not None:
            gap = abs((self.end_radius or 0.0) - self.radius)
            if gap >= self.length:
                text = f"a capsule's length must be above the difference of its radii, {gap:g} m"
                return [("shape", f"{text}, got {self.length:g}")]
        return []

    def surface(self) -> tuple[Array, Array]:
        """Return (vertices (n, 3), triangles (m, 3)) for the closed surface of a heightfield [m].

        The vertices of the top come first, row by row. The two triangles of a cell share the
        diagonal from its smallest x and y to its largest.
        """
        heights = np.array(self.heights)
        nx, ny = heights.shape
        x, y, depth = self.size or (1.0, 1.0, 1.0)
        places = np.meshgrid(
            np.linspace(-x / 2, x / 2, nx), np.linspace(-y / 2, y / 2, ny), indexing="ij"
        )
        top = np.stack((*places, heights), axis=-1).reshape(-1, 3)
        floor = top.copy()
        floor[:, 2] = heights.min() - depth
        number = np.arange(nx * ny).reshape(nx, ny)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        faces = [np.stack((a, b, c), -1).reshape(-1, 3), np.stack((a, c, d), -1).reshape(-1, 3)]
        below = nx * ny
        faces += [below + face[:, ::-1] for face in faces]
        rim = np.concatenate((number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2:0:-1]))
        after = np.roll(rim, -1)
        faces += [np.stack((rim, below + rim, below + after), -1)]
        faces += [np.stack((rim, below + after, after), -1)]
        return np.concatenate((top, floor)), np.concatenate(faces)


DIMENSIONS: dict[str, tuple[str, ...]] = {  # kind -> the fields that say how large it is
    "box": ("size",),
    "sphere": ("radius",),
    "ellipsoid": ("radii",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("file",),
    "heightfield": ("size", "heights"),
}
FOREIGN = {  # kind -> the fields that say how large others are
    kind: sorted(set().union(*DIMENSIONS.values()) - set(own))
    + ([] if kind in ("capsule", "cylinder") else ["end_radius"])
    for kind, own in DIMENSIONS.items()
}


def _doubled(kind: str, name: str, value: Any) -> str:
    """Return the fields of a cylinder or a capsule for its size in MuJoCo, or ""."""
    given: Any = listed(value)
    pair = name == "size" and "length" in DIMENSIONS[kind] and isinstance(given, tuple)
    if not pair or len(given) != 2 or not all(isinstance(x, (int, float)) for x in given):
        return ""
    return f", for MuJoCo's radius and half length radius={given[0]:g}, length={2 * given[1]:g}"


def _one(kind: str) -> str:
    return f"an {kind}" if kind == "ellipsoid" else f"a {kind}"


class MassProperties(NamedTuple):
    """The mass properties of a rigid body in its own frame."""

    mass: float  # [kg]
    com: Array  # (3,) [m]
    inertia: Array  # (3, 3) about the centre of mass, in body axes [kg m^2]


def mass_properties(shape: Shape, density: float, unit: str = "m") -> MassProperties:
    """Return the mass properties of a homogeneous shape with `density` [kg/m^3].

    A mesh must be closed, and `unit` is the unit of its file. Raises ModelError, FileError.
    """
    if not 0 < density < math.inf:
        raise ModelError(
            Problem("shape", "density", f"must be a number > 0 [kg/m^3], got {density}")
        )
    volume, middle, second = _volume(shape, unit)
    turn = matrix(shape.rotation)
    com = np.array(shape.position) + turn @ middle
    return MassProperties(density * volume, com, density * turn @ second @ turn.T)


def _volume(shape: Shape, unit: str) -> tuple[float, Array, Array]:
    """Return the volume, centre and inertia about the centre at density 1, in its frame."""
    if shape.kind == "mesh":
        mesh = load_mesh(shape.file or "", shape.scale, unit)
        if reason := leak(mesh):
            do = "repair the file, or give the body its own mass, com and inertia"
            raise ModelError(Problem(f"mesh {shape.file}", "", f"{reason}; {do}"))
        mesh.density = 1.0
        found = mesh.mass_properties
        sign = math.copysign(1.0, found.volume)  # all faces may be inside out
        return sign * found.volume, np.array(found.center_mass), sign * np.array(found.inertia)
    if shape.kind == "heightfield":
        return _enclosed(*shape.surface())
    r, h = shape.radius or 0.0, shape.length or 0.0
    if shape.end_radius is not None:
        return _turned(shape)
    if shape.kind == "ellipsoid":
        x, y, z = shape.radii or (0.0, 0.0, 0.0)
        volume = 4 / 3 * math.pi * x * y * z
        moments = volume / 5 * np.array((y * y + z * z, x * x + z * z, x * x + y * y))
    elif shape.kind == "box":
        x, y, z = shape.size or (0.0, 0.0, 0.0)
        volume = x * y * z
        moments = volume / 12 * np.array((y * y + z * z, x * x + z * z, x * x + y * y))
    elif shape.kind == "sphere":
        volume = 4 / 3 * math.pi * r**3
        moments = volume * 0.4 * r * r * np.ones(3)
    else:
        middle = math.pi * r * r * h
        caps = 4 / 3 * math.pi * r**3 if shape.kind == "capsule" else 0.0
        volume = middle + caps
        about = caps * 0.4 * r * r + middle * r * r / 2
        across = middle * (h * h / 12 + r * r / 4)
        # a cap's centre is 3r/8 beyond the end of the cylinder
        across += caps * (0.4 * r * r + h * h / 4 + 3 * h * r / 8)
        moments = np.array((across, across, about))
    return volume, np.zeros(3), np.diag(moments)


def profile(shape: Shape) -> list[tuple[float, float, float, float, float]]:
    """Return a capsule or cylinder along z as segments (from, to, a, b, c), r² = a + b z + c z²."""
    r, h = shape.radius or 0.0, shape.length or 0.0
    end = r if shape.end_radius is None else shape.end_radius
    low, high, pieces = -h / 2, h / 2, []
    caps = shape.kind == "capsule"
    # the cone touches both balls along circles: its sine is the difference of the radii over h
    sine = (r - end) / h if caps else 0.0
    cosine = math.sqrt(1 - sine * sine)
    first, last = low + r * sine * caps, high + end * sine * caps
    slope = (end - r) * cosine / (last - first)
    start = r * cosine - slope * first
    if caps:
        pieces.append((low - r, first, r * r - low * low, 2 * low, -1.0))
        pieces.append((last, high + end, end * end - high * high, 2 * high, -1.0))
    pieces.append((first, last, start * start, 2 * start * slope, slope * slope))
    return pieces


def _turned(shape: Shape) -> tuple[float, Array, Array]:
    """Return `_volume` for a tapered shape from discs along z, exact with Gauss quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    z, dz, square = [], [], []
    for low, high, a, b, c in profile(shape):
        at = (low + high) / 2 + (high - low) / 2 * nodes
        z.append(at)
        dz.append((high - low) / 2 * weights)
        square.append(a + b * at + c * at * at)
    z, area = np.concatenate(z), math.pi * np.concatenate(dz) * np.concatenate(square)
    volume = float(area.sum())
    middle = float(area @ z) / volume
    disc = area * np.concatenate(square) / 4  # inertia of each disc about a diameter
    across = float(disc.sum() + area @ (z - middle) ** 2)
    return volume, np.array((0.0, 0.0, middle)), np.diag((across, across, 2 * float(disc.sum())))


def _enclosed(vertices: Array, faces: Array) -> tuple[float, Array, Array]:
    """Return `_volume` for a closed surface, using tetrahedra from the origin [Tonon 2004]."""
    p = vertices[faces]
    volumes = np.linalg.det(p) / 6
    volume = volumes.sum()
    middle = volumes @ p.sum(axis=1) / (4 * volume)
    sums = p.sum(axis=1)
    each = np.einsum("kai,kaj->kij", p, p) + np.einsum("ki,kj->kij", sums, sums)
    second = np.einsum("k,kij->ij", volumes, each) / 20 - volume * np.outer(middle, middle)
    return float(volume), middle, np.trace(second) * np.eye(3) - second


def leak(mesh: Any) -> str:
    """Return the reason why a mesh has no volume, or ""."""
    if mesh.is_watertight and mesh.is_winding_consistent:
        return ""
    edges = np.sort(mesh.edges, axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    open_edges = int((counts != 2).sum())
    if open_edges:
        return f"is not closed: {open_edges} of its edges do not have two faces"
    return "has faces with inconsistent winding"


def solids_of(shapes: Sequence[Shape]) -> Sequence[Shape]:
    """Return the shapes that have mass: the contact shapes if any, otherwise all shapes."""
    return [s for s in shapes if s.role != "visual"] or shapes


def mass_properties_of(shapes: Sequence[Shape], density: float) -> MassProperties:
    """Return the mass properties of several homogeneous shapes. Overlaps count twice.

    Raises ModelError, FileError.
    """
    parts = [mass_properties(shape, density) for shape in solids_of(shapes)]
    mass = sum(part.mass for part in parts)
    com = np.array(sum(part.mass * part.com for part in parts)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return MassProperties(mass, com, inertia)


def tip_of(shapes: Sequence[Shape]) -> Vec3:
    """Return the far end of the shapes' bounding box along its longest edge [m]."""
    corners = np.concatenate([corners_of(shape) for shape in solids_of(shapes)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    k = int(np.argmax(high - low))
    tip = (low + high) / 2
    tip[k] = high[k] if abs(high[k]) >= abs(low[k]) else low[k]
    x, y, z = tip.tolist()
    return (x, y, z)


def corners_of(shape: Shape) -> Array:
    """Return (n, 3) points in body axes whose bounding box tightly encloses the shape."""
    if shape.kind == "mesh":
        points = np.asarray(load_mesh(shape.file or "", shape.scale).vertices)
    elif shape.kind == "heightfield":
        points = shape.surface()[0]
    else:
        r = max(shape.radius or 0.0, shape.end_radius or 0.0)
        caps = r * (shape.kind != "cylinder")
        edges = shape.size or (shape.radii and tuple(2 * x for x in shape.radii))
        half = np.array(edges or (2 * r, 2 * r, (shape.length or 0.0) + 2 * caps)) / 2
        signs = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        points = half * signs
    return np.array(shape.position) + points @ matrix(shape.rotation).T

"""Joints proposed from the faces of two parts that fit into each other or touch.

A fit (a shaft in a bore, a ball in a socket) or a contact of planes gives rows of velocity
constraints. The motions that all rows of a pair leave free are its joint. Nothing here knows the
library that reads the faces.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from ..errors import InputError, Problem, Suggests, choices, explained, shown
from ..rotation import frame_of, normals_of
from ..tolerances import NOTABLE, TOUCHING, VISIBLE

Array = np.ndarray
JointOfStep = Literal["weld", "revolute", "prismatic", "cylindrical", "spherical", "planar"]
# kinds of joints, those that lead a tree first
KINDS: tuple[JointOfStep, ...] = (
    "weld", "revolute", "prismatic", "cylindrical", "spherical", "planar",
)  # fmt: skip
FIT = 5 * VISIBLE  # largest clearance and misalignment of a fit, relative to its radius
MOST_TRIANGLES = 4000  # triangles of two planes that are compared at once


@dataclass(frozen=True, eq=False)
class Face:
    """A face of a part in the axes of the assembly [m].

    `radius` is that of a cylinder, a sphere or the tube of a torus; `wide` is the half angle of a
    cone [rad] or the large radius of a torus. The `point` of a cone is its apex. `side` is 1 if the
    material is inside, as in a shaft, and -1 for a bore.
    """

    surface: Literal["plane", "cylinder", "cone", "sphere", "torus"]
    point: Array
    axis: Array  # unit vector, outward for a plane
    box: Array  # (2, 3) lowest and highest corner
    radius: float = 0.0
    wide: float = 0.0
    side: int = 1
    low: float = 0.0  # range along the axis from `point`
    high: float = 0.0
    share: float = 1.0  # share of a turn, or of a whole sphere
    triangles: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))  # the area of a plane
    blur: float = 0.0  # chord error of the triangles


class Faced(Protocol):
    """A part with a name, faces and a box around all of them."""

    @property
    def name(self) -> str: ...
    @property
    def faces(self) -> Sequence[Face]: ...
    @property
    def box(self) -> Array: ...


@explained
@dataclass(frozen=True)
class Proposal(Suggests):
    """A joint between two parts of an assembly, proposed from their faces."""

    kind: JointOfStep
    bodies: tuple[str, str]
    point: tuple[float, float, float]  # on the first body, in the axes of the assembly [m]
    axis: tuple[float, float, float]  # axis on the first body, without meaning for a weld or a ball
    other_point: tuple[float, float, float]  # the same place on the second body
    other_axis: tuple[float, float, float]
    evidence: str
    gap: float  # distance of the features that the joint brings together [m]
    selected: bool  # True if it is accepted by default

    def changed(self, kind: JointOfStep) -> Proposal:
        """Return the joint as another kind at the same place. Raises InputError."""
        if kind not in KINDS:
            text = f"must be one of {choices(KINDS)}, got {shown(kind)}"
            raise InputError(Problem(f"joint of {' and '.join(self.bodies)}", "kind", text))
        return Proposal(**{**vars(self), "kind": kind, "selected": True})

    def __str__(self) -> str:
        first, second = self.bodies
        gap = f", {self.gap * 1000:.3g} mm apart" if self.gap > NOTABLE / 1000 else ""
        return f"{self.kind} between '{first}' and '{second}': {self.evidence}{gap}"


@dataclass(frozen=True, eq=False)
class Evidence:
    """Two faces that restrain each other, with the place and axis of each."""

    kind: str
    points: tuple[Array, Array]
    axes: tuple[Array, Array]
    gap: float
    text: str


# -- pairs of faces --------------------------------------------------------------------------------


def merged(faces: Iterable[Face], tolerance: float) -> list[Face]:
    """Return the faces, with the parts of one cylinder, which files split, as one face."""
    faces = list(faces)
    kept = [face for face in faces if face.surface != "cylinder"]
    for group in _cylinders([face for face in faces if face.surface == "cylinder"], tolerance):
        along = sorted((_along(face, group[0]) for face in group), key=lambda face: face.low)
        run = [along[0]]
        for face in along[1:]:
            if face.low <= max(x.high for x in run) + tolerance:
                run.append(face)
            else:
                kept.append(_whole(run))
                run = [face]
        kept.append(_whole(run))
    return kept


def _cylinders(faces: Sequence[Face], tolerance: float) -> Iterator[list[Face]]:
    """Yield the faces on each cylinder: of one axis, radius and side."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    if not faces:
        return
    axes, points = (np.array([getattr(face, x) for face in faces]) for x in ("axis", "point"))
    corners = np.array([face.box for face in faces])
    start, size = corners.mean(axis=(0, 1)), float(np.ptp(corners, axis=(0, 1)).max())
    out = points - start
    feet = out - np.einsum("ni,ni->n", out, axes)[:, None] * axes
    ways = (axes[:, :, None] * axes[:, None, :]).reshape(-1, 9) * size  # the same for both signs
    rest = np.array([(face.radius, face.side * size) for face in faces])
    pairs = KDTree(np.hstack((feet, ways, rest))).query_pairs(4 * tolerance, output_type="ndarray")
    joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(faces), len(faces)))
    _, labels = connected_components(joined, directed=False)
    order = np.argsort(labels, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
        yield [faces[k] for k in group]


def _along(face: Face, first: Face) -> Face:
    """Return a face with its range measured along another one's axis."""
    way, start = float(face.axis @ first.axis), float((face.point - first.point) @ first.axis)
    ends = sorted((start + way * face.low, start + way * face.high))
    moved = {"point": first.point, "axis": first.axis, "low": ends[0], "high": ends[1]}
    return Face(**{**vars(face), **moved})


def _whole(run: Sequence[Face]) -> Face:
    low, high = min(x.low for x in run), max(x.high for x in run)
    covered = sum(x.share * (x.high - x.low) for x in run)
    box = np.array((np.min([x.box[0] for x in run], 0), np.max([x.box[1] for x in run], 0)))
    share = covered / (high - low) if high > low else 0.0
    return Face(**{**vars(run[0]), "low": low, "high": high, "share": share, "box": box})


def evidence_of(a: Face, b: Face, tolerance: float) -> Evidence | None:
    """Return how two faces of two parts restrain each other, or None."""
    if a.surface != b.surface:
        return None
    if a.surface == "plane":
        return _contact(a, b, tolerance)
    if a.side == b.side:
        return None
    find = {"cylinder": _shaft, "sphere": _ball, "cone": _cone, "torus": _torus}[a.surface]
    return find(a, b, tolerance)


def _fits(a: Face, b: Face, tolerance: float) -> bool:
    """Check whether the inner face has room in the outer one, with a clearance of a fit."""
    inner, outer = (a, b) if a.side > 0 else (b, a)
    room = outer.radius - inner.radius
    return -tolerance <= room <= FIT * outer.radius + tolerance


def _shaft(a: Face, b: Face, tolerance: float) -> Evidence | None:
    bore = a if a.side < 0 else b
    if not _fits(a, b, tolerance) or bore.share <= (1 + NOTABLE) / 2:
        return None  # a bore that does not go round more than half lets its shaft out
    way = float(a.axis @ b.axis)
    if abs(way) < 1 / 2:
        return None
    other = _along(b, a)
    low, high = max(a.low, other.low), min(a.high, other.high)
    if high - low <= tolerance:
        return None
    axis = b.axis * math.copysign(1.0, way)
    middle = a.point + (low + high) / 2 * a.axis
    places = [a.point + s * a.axis for s in (low, high)]
    gaps = [np.linalg.norm(np.cross(axis, x - b.point)) for x in places]
    if max(gaps) > max(tolerance, FIT * a.radius):
        return None
    there = b.point + ((middle - b.point) @ axis) * axis
    gap = float(np.linalg.norm(there - middle))
    sizes = sorted({f"{2000 * x.radius:.6g}" for x in (a, b)})
    text = f"coaxial cylinders of {' and '.join(sizes)} mm"
    return Evidence(
        "cylindrical", (middle, there), (a.axis, axis), max(gap, *map(float, gaps)), text
    )


def _ball(a: Face, b: Face, tolerance: float) -> Evidence | None:
    socket, gap = a if a.side < 0 else b, float(np.linalg.norm(a.point - b.point))
    if not _fits(a, b, tolerance) or socket.share <= 1 / 4:
        return None
    if gap > max(tolerance, FIT * a.radius):
        return None
    text = f"concentric spheres of {2000 * a.radius:.6g} mm"
    return Evidence("spherical", (a.point, b.point), (a.axis, a.axis), gap, text)


def _cone(a: Face, b: Face, tolerance: float) -> Evidence | None:
    length = max(abs(x) for face in (a, b) for x in (face.low, face.high))
    slack = tolerance / length if length else 0.0
    if abs(a.wide - b.wide) > slack:
        return None
    return _same_place(a, b, tolerance, slack, "coaxial cones with one apex")


def _torus(a: Face, b: Face, tolerance: float) -> Evidence | None:
    if not _fits(a, b, tolerance) or abs(a.wide - b.wide) > max(tolerance, FIT * a.radius):
        return None
    slack = tolerance / a.wide if a.wide else 0.0
    return _same_place(a, b, tolerance, slack, "concentric rings")


def _same_place(a: Face, b: Face, tolerance: float, slack: float, text: str) -> Evidence | None:
    gap, way = float(np.linalg.norm(a.point - b.point)), float(a.axis @ b.axis)
    if gap > tolerance or np.linalg.norm(np.cross(a.axis, b.axis)) > slack:
        return None
    axes = (a.axis, b.axis * math.copysign(1.0, way))
    return Evidence("revolute", (a.point, b.point), axes, gap, text)


def _contact(a: Face, b: Face, tolerance: float) -> Evidence | None:
    """Return the contact of two planes that face each other and share an area."""
    size = float(np.max(a.box[1] - a.box[0] + b.box[1] - b.box[0]))
    if a.axis @ b.axis > 0 or np.linalg.norm(np.cross(a.axis, b.axis)) * size > tolerance:
        return None
    gap = float((b.point - a.point) @ a.axis)
    if abs(gap) > tolerance or not _overlap(a, b, tolerance):
        return None
    both = np.array((np.maximum(a.box[0], b.box[0]), np.minimum(a.box[1], b.box[1]))).mean(0)
    here = both - ((both - a.point) @ a.axis) * a.axis
    return Evidence("planar", (here, here + gap * a.axis), (a.axis, -b.axis), abs(gap), "planes")


def _overlap(a: Face, b: Face, tolerance: float) -> bool:
    """Check whether two coplanar faces share an area, and not a line at their edges alone.

    Triangles miss an arc by the chord error, so that an area counts from this width on around the
    smaller face.
    """
    across = frame_of(a.axis)[:, :2]
    first, second = (_near(x.triangles, y.box, tolerance) @ across for x, y in ((a, b), (b, a)))
    if not (len(first) and len(second)):
        return False
    around = min(float(np.ptp(x.reshape(-1, 2), axis=0).sum()) for x in (first, second))
    left = 2 * around * (a.blur + b.blur + tolerance)
    rows = max(MOST_TRIANGLES // len(second), 1)
    for k in range(0, len(first), rows):
        for i, j in np.argwhere(_meet(first[k : k + rows], second)):
            left -= _shared_area(first[k + i], second[j])
            if left < 0:
                return True
    return False


def _shared_area(one: Array, other: Array) -> float:
    """Return the area that two triangles (3, 2) share, by cutting one along the other's edges."""
    kept = [complex(*x) for x in one]
    corners = [complex(*x) for x in other]
    if _area(corners) < 0:
        corners.reverse()
    for start, end in zip(corners, corners[1:] + corners[:1]):
        sides = [((x - start) / (end - start)).imag for x in kept] if end != start else []
        cut = list[complex]()
        for k, (x, side) in enumerate(zip(kept, sides)):
            after, far = kept[(k + 1) % len(kept)], sides[(k + 1) % len(kept)]
            if side >= 0:
                cut.append(x)
            if (side < 0) != (far < 0):
                cut.append(x + (after - x) * side / (side - far))
        kept = cut
    return abs(_area(kept))


def _area(corners: Sequence[complex]) -> float:
    return sum((x.conjugate() * y).imag for x, y in zip(corners, [*corners[1:], *corners[:1]])) / 2


def _near(triangles: Array, box: Array, tolerance: float) -> Array:
    """Return the triangles (n, 3, 3) whose boxes meet a box."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    return triangles[((low <= box[1] + tolerance) & (high >= box[0] - tolerance)).all(axis=1)]


def _meet(first: Array, second: Array) -> Array:
    """Return which triangles (n, 3, 2) and (m, 3, 2) may overlap: no axis separates them."""
    apart = np.zeros((len(first), len(second)), bool)
    for own, other in ((first, second), (second, first)):
        edges = np.roll(own, -1, axis=1) - own
        normals = np.stack((edges[..., 1], -edges[..., 0]), axis=-1)
        mine = np.einsum("iaj,ikj->ika", own, normals)
        yours = np.einsum("maj,ikj->imka", other, normals)
        low, high = mine.min(-1)[:, None], mine.max(-1)[:, None]
        found = ((yours.min(-1) >= high) | (yours.max(-1) <= low)).any(-1)
        apart |= found if own is first else found.T
    return ~apart


# -- joints ----------------------------------------------------------------------------------------


# kind -> directions in which places, and about which turns are held, of (axis, two across)
HELD: dict[str, tuple[slice, slice]] = {
    "weld": (slice(0, 3), slice(0, 3)),
    "revolute": (slice(0, 3), slice(1, 3)),
    "prismatic": (slice(1, 3), slice(0, 3)),
    "cylindrical": (slice(1, 3), slice(1, 3)),
    "spherical": (slice(0, 3), slice(0, 0)),
    "planar": (slice(0, 1), slice(1, 3)),
}


def _rows(kind: str, point: Array, axis: Array, size: float) -> Array:
    """Return the rows of velocity constraints over (angular velocity, velocity / size).

    The velocity is that of the origin, which is near the pair.
    """
    axes = np.array((axis, *normals_of(axis)))
    places, turns = (axes[which] for which in HELD[kind])
    moving = np.hstack((np.cross(point, places) / size, places))
    return np.vstack((moving, np.hstack((turns, np.zeros_like(turns)))))


def joint_of(
    restraints: Sequence[tuple[str, Array, Array]], slack: float
) -> tuple[JointOfStep, Array, Array] | None:
    """Return (kind, point, axis) of the joint that all restraints (kind, point, axis) leave.

    Directions that differ by less than `slack` are one. None stands for a motion that is no joint.
    """
    start = np.mean([point for _, point, _ in restraints], axis=0)
    span = max(float(np.linalg.norm(point - start)) for _, point, _ in restraints)
    size = span or 1.0
    rows = np.vstack([_rows(kind, p - start, axis, size) for kind, p, axis in restraints])
    _, sizes, motions = np.linalg.svd(rows)
    rank = int(np.sum(sizes > slack * sizes[0]))
    found = _named(motions[rank:], size, slack)
    if found is None:
        return None
    kind, point, axis = found
    return kind, start + point, axis


def _named(motions: Array, size: float, slack: float) -> tuple[JointOfStep, Array, Array] | None:
    """Return (kind, point, axis) of free motions (k, 6), whose point is nearest to the origin."""
    zero, z = np.zeros(3), np.array((0.0, 0.0, 1.0))
    if not len(motions):
        return "weld", zero, z
    left, sizes, right = np.linalg.svd(motions[:, :3])
    turning = int(np.sum(sizes > slack))
    mixed = left.T @ motions  # the turning motions first, and then slides
    slides = mixed[turning:, 3:]
    match len(motions), turning:
        case 1, 0:
            return "prismatic", zero, _unit(slides[0])
        case (1 | 2 | 3) as dof, 1:
            axis, v = _unit(mixed[0, :3]), mixed[0, 3:] / np.linalg.norm(mixed[0, :3]) * size
            point = np.cross(axis, v)
            along = np.abs(slides @ axis) > math.sqrt(1 / 2)
            if dof == 1 and abs(v @ axis) <= slack * size:
                return "revolute", point, axis
            if dof == 2 and along.all() and np.linalg.norm(np.cross(slides[0], axis)) <= slack:
                return "cylindrical", point, axis
            if dof == 3 and np.abs(slides @ axis).max() <= slack:
                return "planar", zero, axis
        case 3, 3:
            turn, v = mixed[:, :3], mixed[:, 3:] * size
            speeds = np.linalg.solve(turn, v)  # centre x axis, of the origin
            if np.abs(speeds + speeds.T).max() <= slack * size:
                return "spherical", np.array((speeds[1, 2], speeds[2, 0], speeds[0, 1])), z
        case _:
            pass
    return None


def _unit(x: Array) -> Array:
    return x / np.linalg.norm(x)


# -- proposals -------------------------------------------------------------------------------------


def proposed(parts: Sequence[Faced], tolerance: float) -> list[Proposal]:
    """Return at most one joint for each pair of parts, in the order of the parts.

    Features are at one place if they are closer than `tolerance` [m], or fit.
    """
    faces = [merged(part.faces, tolerance) for part in parts]
    found = list[Proposal]()
    for i, j in _neighbours([part.box for part in parts], tolerance):
        pairs = _neighbours_of(faces[i], faces[j], tolerance)
        evidence = [x for a, b in pairs if (x := evidence_of(a, b, tolerance))]
        if evidence and (one := _reduced(parts[i], parts[j], evidence, tolerance)):
            found.append(one)
    return found


def _neighbours(boxes: Sequence[Array], tolerance: float) -> Iterator[tuple[int, int]]:
    """Yield the pairs of boxes that meet."""
    low, high = (np.array([box[k] for box in boxes]).reshape(-1, 3) for k in (0, 1))
    for i in range(len(boxes)):
        meets = (low[i + 1 :] <= high[i] + tolerance) & (high[i + 1 :] >= low[i] - tolerance)
        yield from ((i, i + 1 + int(k)) for k in np.flatnonzero(meets.all(axis=1)))


def _neighbours_of(
    a: Sequence[Face], b: Sequence[Face], tolerance: float
) -> Iterator[tuple[Face, Face]]:
    """Yield the pairs of faces whose boxes meet."""
    if not (a and b):
        return
    low, high = np.array([face.box for face in b]).transpose(1, 0, 2)
    for face in a:
        slack = max(tolerance, FIT * face.radius)
        meets = (low <= face.box[1] + slack) & (high >= face.box[0] - slack)
        yield from ((face, b[int(k)]) for k in np.flatnonzero(meets.all(axis=1)))


def _reduced(
    first: Faced, second: Faced, evidence: Sequence[Evidence], tolerance: float
) -> Proposal | None:
    """Return the joint that all evidence for two parts leaves, or None.

    A plane is held by one that is opposite, or where a fit has a shoulder. One that touches from
    one side, such as a stop, never takes the last freedom.
    """
    fits = [x for x in evidence if x.kind != "planar"]
    planes = [x for x in evidence if x.kind == "planar"]
    held = [x for x in planes if _is_held(x, fits, planes)]
    size = min(float(np.ptp(part.box, axis=0).max()) for part in (first, second))
    worst = max(x.gap for x in evidence)
    slack = max(TOUCHING, worst / size)
    chosen = [*fits, *held]
    for one in (x for x in planes if x not in held):
        tried = _joint_at(0, [*chosen, one], slack)
        if tried is not None and tried[0] != "weld":
            chosen.append(one)
    here, there = (_joint_at(k, chosen, slack) for k in (0, 1))
    if here is None or there is None or here[0] != there[0]:
        return None
    kind, point, axis = here
    _, other, other_axis = there
    if axis @ other_axis < 0:
        other_axis = -other_axis
    if fits and kind in ("revolute", "cylindrical"):  # the place where the axes meet
        point = _onto(np.mean([x.points[0] for x in fits], axis=0), point, axis)
        other = _onto(point, other, other_axis)
    gap = max((x.gap for x in chosen), default=0.0)
    both = tuple(float(x) for x in point), tuple(float(x) for x in axis)
    others = tuple(float(x) for x in other), tuple(float(x) for x in other_axis)
    selected = kind != "planar" and bool(fits or _opposed(planes))
    names, text = (first.name, second.name), _text(fits, [x for x in chosen if x not in fits])
    found: Any = (kind, names, *both, *others, text, gap, selected)
    return Proposal(*found)


def _onto(x: Array, point: Array, axis: Array) -> Array:
    return point + ((x - point) @ axis) * axis


def _joint_at(
    k: int, evidence: Sequence[Evidence], slack: float
) -> tuple[JointOfStep, Array, Array] | None:
    if not evidence:
        return None
    return joint_of([(x.kind, x.points[k], x.axes[k]) for x in evidence], slack)


def _is_held(plane: Evidence, fits: Sequence[Evidence], planes: Sequence[Evidence]) -> bool:
    across = any(
        abs(plane.axes[0] @ x.axes[0]) > 1 - TOUCHING for x in fits if x.kind != "spherical"
    )
    return across or any(plane.axes[0] @ x.axes[0] < TOUCHING - 1 for x in planes)


def _opposed(planes: Sequence[Evidence]) -> bool:
    return any(a.axes[0] @ b.axes[0] < TOUCHING - 1 for a, b in itertools.combinations(planes, 2))


def _text(fits: Sequence[Evidence], planes: Sequence[Evidence]) -> str:
    counts = dict[str, int]()
    for one in fits:
        counts[one.text] = counts.get(one.text, 0) + 1
    texts = [f"{n} times {text}" if n > 1 else text for text, n in counts.items()]
    if planes:
        many = f"{len(planes)} contacts of planes"
        texts.append(many if len(planes) > 1 else "planes in contact")
    return ", ".join(texts)

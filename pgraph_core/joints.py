"""Joint kinds as sequences of elementary motions, the kinds for the DoF column, and joint
checks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from .errors import choices, counted, shown
from .rotation import Array, matrix, rodrigues, unit_vector

Vector = tuple[float, float, float]
JointKind = Literal[
    "weld",
    "revolute",
    "prismatic",
    "screw",
    "cylindrical",
    "universal",
    "spherical",
    "planar",
    "free",
    "curve",
    "compound",
]
MotionKind = Literal["rotate", "screw", "translate", "ball", "free", "curve"]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Motion(NamedTuple):
    """One elementary motion. A joint is a sequence of motions from parent to body."""

    kind: MotionKind
    axis: Vector  # axis in the body's axes at q = 0, unused for ball, free and curve
    pitch: float = 0.0  # way along the axis of a screw [m a turn]
    track: Any = None  # `tracks.Track` of a curve

    def along(self, home: Array) -> Array:
        """Return the unit axis in the axes before the motion, for a body of orientation `home`."""
        return unit_vector(home @ self.axis)

    @property
    def way(self) -> float:
        """The way along the axis of a screw [m/rad]."""
        return self.pitch / math.tau

    @property
    def facts(self) -> Kind:
        """The properties of its kind."""
        return KINDS[self.kind]


BALL = Motion("ball", Z)


class Kind(NamedTuple):
    """Properties of a kind of motion: units of coordinates and velocities, q at home, geometry.

    The functions take a motion and the orientation (3, 3) of its body at q = 0, and give vectors in
    the axes before the motion. New limits allow q up to `reach` to either side.
    """

    q: tuple[str, ...]
    v: tuple[str, ...]  # a second less, as [rad/s]
    home: tuple[float, ...]
    rotation: Callable[[Motion, Array, Any], Array]  # (motion, home, q) to a matrix (3, 3)
    displacement: Callable[[Motion, Array, Any], Array]  # the same to (3,) [m]
    columns: Callable[[Motion, Array, Any], Array]  # the same to H (6, nv), eqs. (6), (7)
    # the same to the derivative of H in the only coordinate, if H is not constant
    bends: Callable[[Motion, Array, Any], Array] = lambda motion, home, q: np.zeros((6, 1))
    turns: bool = False  # the body turns, on a curve if its track says so
    travels: bool = False  # its origin moves in the axes before the motion
    directed: bool = False  # about or along an axis
    tracked: bool = False  # along the track of its body
    pitch: float = 0.0  # the usual way in a turn [m], if it has one
    reach: float | None = None  # None: it takes no limits

    @property
    def single(self) -> bool:
        """Return True if there is one coordinate."""
        return len(self.q) == 1

    @property
    def attitude(self) -> bool:
        """Return True if a quaternion ends q, with the angular velocity at the beginning of v."""
        return self.q[-4:] == ("1",) * 4

    @property
    def alone(self) -> bool:
        """Return True if it has all six freedoms, so that a joint has no other motion."""
        return len(self.v) == 6

    @property
    def flat(self) -> bool:
        """Return True if every point stays in a plane, which an axis determines."""
        return self.directed and self.turns != self.travels

    @property
    def pivots(self) -> bool:
        """Return True if it is about a fixed axis, so that a whole turn changes nothing."""
        return self.flat and self.turns


def _column(angular: Array, linear: Array) -> Array:
    return np.concatenate((angular, linear))[:, None]


def _turned(pair: Array, home: Array) -> Array:
    """Return [angular, linear] (6,), given in the axes of the body, as a column (6, 1)."""
    return (pair.reshape(2, 3) @ home.T).reshape(6, 1)


def units_of(motion: Motion) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the units of the coordinates of a motion, and of its velocities without a second."""
    if motion.track is not None:
        return (motion.track.unit,), (motion.track.unit,)
    kind = KINDS[motion.kind]
    return kind.q, kind.v


def slides(motion: Motion) -> bool:
    """Return True if the only coordinate of a motion is a length."""
    return units_of(motion)[0] == ("m",)


ONE, NONE = np.eye(3), np.zeros(3)
KINDS: dict[MotionKind, Kind] = {
    "rotate": Kind(
        ("rad",),
        ("rad",),
        (0.0,),
        rotation=lambda motion, home, q: rodrigues(motion.along(home), q[0]),
        displacement=lambda motion, home, q: NONE,
        columns=lambda motion, home, q: _column(motion.along(home), NONE),
        turns=True,
        directed=True,
        reach=math.pi,
    ),
    "screw": Kind(
        ("rad",),
        ("rad",),
        (0.0,),
        rotation=lambda motion, home, q: rodrigues(motion.along(home), q[0]),
        displacement=lambda motion, home, q: motion.along(home) * motion.way * q[0],
        columns=lambda motion, home, q: _column(
            motion.along(home), motion.way * motion.along(home)
        ),
        turns=True,
        travels=True,
        directed=True,
        pitch=0.01,
        reach=math.pi,
    ),
    "translate": Kind(
        ("m",),
        ("m",),
        (0.0,),
        rotation=lambda motion, home, q: ONE,
        displacement=lambda motion, home, q: motion.along(home) * q[0],
        columns=lambda motion, home, q: _column(NONE, motion.along(home)),
        travels=True,
        directed=True,
        reach=1.0,
    ),
    "ball": Kind(
        ("1",) * 4,
        ("rad",) * 3,
        (1.0, 0.0, 0.0, 0.0),
        rotation=lambda motion, home, q: matrix(list(q)),
        displacement=lambda motion, home, q: NONE,
        columns=lambda motion, home, q: np.vstack((ONE, 0 * ONE)),
        turns=True,
    ),
    "free": Kind(
        ("m",) * 3 + ("1",) * 4,
        ("rad",) * 3 + ("m",) * 3,
        (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        rotation=lambda motion, home, q: matrix(list(q[3:])),
        displacement=lambda motion, home, q: np.asarray(q[:3]),
        columns=lambda motion, home, q: np.eye(6),
        turns=True,
        travels=True,
    ),
    "curve": Kind(
        ("rad",),  # or a length, as its track says: see `units_of`
        ("rad",),
        (0.0,),
        rotation=lambda motion, home, q: home @ motion.track.at(q[0])[1] @ home.T,
        displacement=lambda motion, home, q: home @ motion.track.at(q[0])[0],
        columns=lambda motion, home, q: _turned(motion.track.slope(q[0]), home),
        bends=lambda motion, home, q: _turned(motion.track.bend(q[0]), home),
        turns=True,
        travels=True,
        tracked=True,
        reach=1.0,
    ),
}
SIZE = {kind: (len(k.q), len(k.v)) for kind, k in KINDS.items()}  # (nq, nv) of a motion
AXIAL = tuple(kind for kind, k in KINDS.items() if k.single)  # kinds with one coordinate
COMBINED = tuple(kind for kind, k in KINDS.items() if not k.alone)  # kinds that joints combine
DIRECTED = tuple(kind for kind, k in KINDS.items() if k.directed)
PITCHED = tuple(kind for kind, k in KINDS.items() if k.pitch)
TRACKED = tuple(kind for kind, k in KINDS.items() if k.tracked)
CODES = {kind: i for i, kind in enumerate(KINDS)}


def code_of(kind: MotionKind, track: Any) -> float:
    """Return the number of a kind in `engine.layout`, where a curve in metres has the next one."""
    return float(CODES[kind] + (track is not None and track.unit == "m"))


DEFAULT: dict[JointKind, tuple[Motion, ...]] = {
    "weld": (),
    "revolute": (Motion("rotate", Z),),
    "prismatic": (Motion("translate", Z),),
    "screw": (Motion("screw", Z, KINDS["screw"].pitch),),
    "cylindrical": (Motion("rotate", Z), Motion("translate", Z)),
    "universal": (Motion("rotate", X), Motion("rotate", Y)),
    "spherical": (BALL,),
    "planar": (Motion("translate", X), Motion("translate", Y), Motion("rotate", Z)),
    "free": (Motion("free", Z),),
    "curve": (Motion("curve", Z),),
    "compound": (BALL, Motion("translate", Z)),
}

# joints that may have a motion along a track
FOLLOWING = ("compound", *(x for x, own in DEFAULT.items() if any(m.kind in TRACKED for m in own)))

# The DoF column: number -> (kind, motions).
OF_DOF: tuple[tuple[JointKind, tuple[Motion, ...]], ...] = (
    ("weld", DEFAULT["weld"]),
    ("revolute", DEFAULT["revolute"]),
    ("universal", DEFAULT["universal"]),
    ("spherical", DEFAULT["spherical"]),
    ("compound", DEFAULT["compound"]),
    ("compound", (BALL, Motion("translate", X), Motion("translate", Y))),
    ("free", DEFAULT["free"]),
)


def nq(motions: tuple[Motion, ...]) -> int:
    """Count the position coordinates in a joint."""
    return sum(SIZE[m.kind][0] for m in motions)


def nv(motions: tuple[Motion, ...]) -> int:
    """Return the number of degrees of freedom in a joint."""
    return sum(SIZE[m.kind][1] for m in motions)


def floats(motions: tuple[Motion, ...]) -> bool:
    """Check whether q of a joint is a place and an attitude, with all six freedoms."""
    return any(m.facts.alone for m in motions)


def restrains(motions: tuple[Motion, ...]) -> bool:
    """Check whether a joint restrains its body: less than six degrees of freedom."""
    return nv(motions) < SIZE["free"][1]


OF_FREE: dict[str, dict[str, slice]] = {  # parts of the numbers of a free joint, by name
    "q": {"position": slice(0, 3), "rotation": slice(3, 7)},
    "v": {"angular": slice(0, 3), "linear": slice(3, 6)},
    "vdot": {"angular": slice(0, 3), "linear": slice(3, 6)},
    "tau": {"torque": slice(0, 3), "force": slice(3, 6)},
}


def in_parts(quantity: str, name: str = "") -> str:
    """Return "{'position': (x, y, z), 'rotation': (w, x, y, z)}" of a free joint."""
    axes = {3: "(x, y, z)", 4: "(w, x, y, z)"}
    parts = (f"{x!r}: {axes[y.stop - y.start]}" for x, y in OF_FREE[quantity].items())
    listed = f"{{{', '.join(parts)}}}"
    return f"{quantity}={{{name!r}: {listed}}}" if name else listed


def joined(quantity: str, given: Any, rest: Sequence[float], free: bool) -> tuple[Any, str]:
    """Return the numbers of a joint, and a problem with their number or "".

    Those of a `free` joint may be given by the names of their parts, with those of `rest` for parts
    that are not given. Three numbers are its position.
    """
    one = isinstance(given, (list, tuple)) or getattr(given, "ndim", 0) == 1
    if free and quantity == "q" and one and len(given) == 3:
        given = {"position": given}
    if not isinstance(given, Mapping):
        if not one or len(given) == len(rest):
            return given, ""
        do = f"; or some of them: {in_parts(quantity)}" if free else ""
        return given, f"takes {counted(len(rest), 'number')}, got {len(given)}{do}"
    parts, found = OF_FREE.get(quantity, {}), list[Any](rest)
    for name, value in given.items():
        own = parts.get(name)
        if own is None or not free:
            names = " and ".join(f"{x!r} ({y.stop - y.start} numbers)" for x, y in parts.items())
            text = f"has no part {shown(name)}; of a free joint, {quantity} takes {names}"
            return found, text
        size = own.stop - own.start
        if not hasattr(value, "__len__") or isinstance(value, str) or len(value) != size:
            return found, f"part {name!r} takes {size} numbers, got {shown(value)}"
        found[own] = value
    return found, ""


def places(motions: tuple[Motion, ...]) -> list[int | None]:
    """Return the index in q of each freedom, or None for rotations of ball and free joints."""
    found: list[int | None] = []
    start = 0
    for m in motions:
        turns = (
            0 if m.kind in AXIAL else 3
        )  # rotations of a quaternion, which no entry of q represents
        found += [None] * turns + list(range(start, start + SIZE[m.kind][1] - turns))
        start += SIZE[m.kind][0]
    return found


def home(motions: tuple[Motion, ...]) -> tuple[float, ...]:
    """Return q = 0 for a joint, with the unit quaternion [1, 0, 0, 0] for a ball or free motion."""
    return tuple(x for m in motions for x in KINDS[m.kind].home)


def no_coordinate(name: str, dof: int, k: int) -> str:
    """Return a sentence about a degree of freedom that the joint of a body does not have."""
    if not dof:
        return f"the joint of '{name}' has no degree of freedom; give the body one that moves"
    text = f"the joint of '{name}' has {counted(dof, 'degree')} of freedom, counted from 0"
    return f"{text}: {choices(map(str, range(dof)))}, got {k}"


# -- what is wrong with a joint --------------------------------------------------------------------

# what a joint has besides its limits, one number a motion
PER_MOTION = (
    "stiffness", "damping", "rest", "friction", "armature",
    "limit_restitution", "speed_limit", "pitch",
)  # fmt: skip

Finding = tuple[str, str]  # (field, sentence)
Motions = tuple[Motion, ...]
Numbers = tuple[float, ...]
Limits = tuple[tuple[float | None, float | None] | None, ...]


def joint_problems(
    joint: JointKind, motions: Motions, q: Numbers, v: Numbers, limits: Limits
) -> list[Finding]:
    """Return problems with the motions, axes, initial state and limits of a joint."""
    found: list[Finding] = []
    if joint != "compound" and _kinds(motions) != _kinds(DEFAULT[joint]):
        found.append(("motions", f"do not match a {joint} joint; use joint 'compound'"))
    if floats(motions) and len(motions) > 1:
        found.append(
            (
                "motions",
                "a free motion cannot be combined with others; use ball and translate motions",
            )
        )
    if nv(motions) > 6:
        found.append(("motions", f"give {nv(motions)} degrees of freedom; at most 6"))
    for m in motions:
        if m.kind in DIRECTED and not 1e-9 < math.hypot(*m.axis) < 1e9:
            found.append(("axes", f"a direction must not be zero, got {list(m.axis)}"))
    found += _parallel_problems(motions)
    for name, value, length in (("q", q, nq(motions)), ("v", v, nv(motions))):
        if len(value) != length:
            found.append(
                (name, f"a {joint} joint has {counted(length, 'number')}, got {len(value)}")
            )
        elif name == "q":
            found += quaternion_problems(value, motions)
    return found + _limit_problems(limits, motions)


def track_problems(track: Any, motions: Motions) -> list[Finding]:
    """Return a problem if a joint lacks the track of its curve, or has one without a curve."""
    curves = sum(m.kind in TRACKED for m in motions)
    if curves > 1:
        return [("motions", f"a joint follows one curve, got {curves}; put a body between them")]
    if curves and track is None:
        text = "a curve needs a track, such as pg.Track(points=[(0, 0, 0), (1, 0, 0.5)])"
        return [("track", text)]
    if track is not None and not curves:
        return [("track", "belongs to a curve; give joint='curve', or leave the track out")]
    return []


def _limit_problems(limits: tuple[Any, ...], motions: tuple[Motion, ...]) -> list[Finding]:
    """Return problems with limits: a wrong number or order, or a motion without a position."""
    if not limits:
        return []
    if not motions:
        return [("limits", f"a weld has no motion, got {shown(limits)}")]
    if len(limits) != len(motions):
        text = f"give one pair for all motions, or one per motion: {len(motions)}"
        return [("limits", f"{text}, got {shown(limits)}")]
    bounded = [(pair, m) for pair, m in zip(limits, motions) if pair is not None]
    if any(m.kind not in AXIAL for _, m in bounded):
        text = "bound a motion of one coordinate, not a ball or free one"
        return [("limits", f"{text}, got {shown(limits)}")]
    return [
        ("limits", f"the lower limit must be less than the upper one, got {shown(pair)}")
        for pair, _ in bounded
        if None not in pair and pair[0] >= pair[1]
    ]


def beyond(q: Numbers, motions: Motions, limits: Limits) -> Iterator[tuple[int, float]]:
    """Yield (motion, excess) for positions beyond their limits [rad, m]."""
    start = 0
    for k, (m, pair) in enumerate(zip(motions, limits)):
        if pair is not None and m.kind in AXIAL:
            low, high = pair
            if low is not None and q[start] < low:
                yield k, low - q[start]
            if high is not None and q[start] > high:
                yield k, q[start] - high
        start += SIZE[m.kind][0]


def _parallel_problems(motions: tuple[Motion, ...]) -> list[Finding]:
    """Return problems with successive collinear rotations or slides, which are one freedom."""
    return [
        (
            "axes",
            f"two successive directions are parallel, got {list(a.axis)} and {list(b.axis)}; "
            "turn one of them",
        )
        for a, b in itertools.pairwise(motions)
        if a.kind == b.kind and a.kind in DIRECTED and parallel(a.axis, b.axis)
    ]


def parallel(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Check whether two directions are parallel to 1e-9 rad: a joint cannot have both."""
    return _norm(_cross(a, b)) <= 1e-9 * _norm(a) * _norm(b)


def _norm(x: tuple[float, ...]) -> float:
    return math.hypot(*x)


def _cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, ...]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _kinds(motions: tuple[Motion, ...]) -> tuple[str, ...]:
    return tuple(m.kind for m in motions)


def quaternion_problems(q: tuple[float, ...], motions: tuple[Motion, ...]) -> list[tuple[str, str]]:
    found, start = [], 0
    for m in motions:
        size = SIZE[m.kind][0]
        if m.kind not in AXIAL:
            quaternion = q[start + size - 4 : start + size]
            if abs(math.hypot(*quaternion) - 1) > 1e-3:
                given = shown(quaternion)
                found.append(("q", f"needs a unit quaternion [w, x, y, z], got {given}"))
        start += size
    return found


def physics_problems(
    name: str, values: tuple[float, ...], motions: tuple[Motion, ...]
) -> list[tuple[str, str]]:
    screws = [m.kind in PITCHED for m in motions] if name == "pitch" else []
    if len(values) == len(motions) and not any(values) and not any(screws):
        return []
    if values and not motions:
        return [(name, f"a weld has no motion, got {list(values)}")]
    if len(values) != len(motions):
        text = f"give one number for all motions, or one per motion: {len(motions)}"
        text += f", got {list(values)}"
        return [(name, text)]
    if name == "pitch":
        if [x != 0 for x in values] == screws:
            return []
        text = "is the advance of a screw per turn [m], which is not 0; no other motion has one"
        return [(name, f"{text}, got {list(values)}")]
    if name != "rest" and any(x < 0 for x in values):
        return [(name, f"must be >= 0, got {list(values)}")]
    if name == "limit_restitution" and any(x > 1 for x in values):
        return [(name, f"must be from 0 to 1, got {list(values)}")]
    of_all = name in ("damping", "friction", "armature")  # the same for each speed of a motion
    if not of_all and any(x and m.kind not in AXIAL for x, m in zip(values, motions)):
        text = "acts on a rotate or translate motion, not on a ball or free one"
        return [(name, f"{text}, got {list(values)}")]
    return []

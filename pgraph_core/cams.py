"""Laws of lift of a cam, and where its follower touches it.

The plane of a cam has complex numbers as its points. Its centre is 0, the cam turns
counter-clockwise with its angle, and the follower moves along +i, or about a pivot at +i times the
distance of the axes, away from the cam as it turns counter-clockwise (an arm on the side of +1).

For a follower at w(θ) over a cam that has turned by θ, w' - i w is the tangent of its path on the
cam, of which the profile is a parallel curve at the radius of a roller. (Norton, Cam Design and
Manufacturing Handbook, chapters 3 and 7, has the same in real numbers, for each kind of follower.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .fields import Frozen, Number, field
from .functions import Array, Curve, Pieces
from .pieces import DEGREE, least
from .tolerances import EPS, NOTABLE
from .units import RAD, Q

Points: TypeAlias = NDArray[np.complexfloating[Any, Any]]
Law = Literal["3-4-5", "4-5-6-7", "cycloidal", "modified sine"]
Follower = Literal["knife", "roller", "flat"]
CLOSE = 512 * EPS  # largest error of the second derivative of a series, relative to its size
SPLIT = 16  # parts of a segment in the search for a least value, each with eight places


class CamSegment(Frozen):
    """A part of a turn of a cam, in which its follower goes to a lift, or rests at it.

    Examples
    --------
    >>> import math, pgraph_core as pg
    >>> rise = pg.CamSegment(lift=0.02, angle=math.pi / 2, law="cycloidal")
    """

    lift: Number = field(
        "a finite number [m, rad]: the coordinate of the follower at the end of the segment",
        dim=Q, help="coordinate of the follower at the end of the segment",
    )  # fmt: skip
    angle: Number | None = field(
        "an angle > 0 [rad]; default: the rest of the turn",
        default=None, gt=0, dim=RAD, help="angle of the cam; default: the rest of the turn",
    )  # fmt: skip
    law: Law = field(
        "one of 3-4-5, 4-5-6-7, cycloidal, modified sine",
        default="3-4-5", help="law of the lift between two values",
    )  # fmt: skip


# -- laws ------------------------------------------------------------------------------------------


class Wave(NamedTuple):
    """The law a + b u + c sin(rate u + phase) up to u = end."""

    end: float
    a: float
    b: float
    c: float
    rate: float
    phase: float


OF_SINE = 1.0 / (4.0 + math.pi)
# lifts over u from 0 to 1: the coefficients of a polynomial, or sines (Norton, chapters 2 and 3)
LAWS: dict[str, tuple[float, ...] | tuple[Wave, ...]] = {
    "3-4-5": (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
    "4-5-6-7": (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0),
    "cycloidal": (Wave(1.0, 0.0, 1.0, -0.5 / math.pi, 2.0 * math.pi, 0.0),),
    "modified sine": (
        Wave(1 / 8, 0.0, OF_SINE * math.pi, -OF_SINE / 4.0, 4.0 * math.pi, 0.0),
        Wave(7 / 8, 2 * OF_SINE, OF_SINE * math.pi, -9 / 4 * OF_SINE, 4 / 3 * math.pi, math.pi / 3),
        Wave(1.0, 4 * OF_SINE, OF_SINE * math.pi, -OF_SINE / 4.0, 4.0 * math.pi, 0.0),
    ),
}


def rise_of(law: str) -> tuple[Array, Array]:
    """Return the places (n,) in u from 0 to 1 and the powers (8, n) of a law that rises by 1."""
    given = LAWS[law]
    if not isinstance(given[0], Wave):
        powers = np.zeros((DEGREE + 1, 1))
        powers[: len(given), 0] = given
        return np.zeros(1), powers
    places, powers, begin = [], [], 0.0
    for wave in given:
        assert isinstance(wave, Wave), "a law is one polynomial, or sines"
        own = _series(wave, begin)
        places.append(own[0])
        powers.append(own[1])
        begin = wave.end
    return np.concatenate(places), np.concatenate(powers, axis=1)


def _series(wave: Wave, begin: float) -> tuple[Array, Array]:
    """Return the places and powers of Taylor series about the middles of equal parts.

    At the ends of a part, x = rate h / 2 from its middle, the second derivative of the sine is off
    by x^6 / 6! of its size, of which the number of parts follows.
    """
    x = (math.factorial(DEGREE - 1) * CLOSE) ** (1.0 / (DEGREE - 1))
    count = math.ceil(wave.rate * (wave.end - begin) / (2.0 * x))
    ends = np.linspace(begin, wave.end, count + 1)
    way = 0.5 * (ends[1] - begin)
    middle = wave.rate * (ends[:-1] + way) + wave.phase
    degrees = range(DEGREE + 1)
    about = [wave.c * wave.rate**k * np.sin(middle + 0.5 * k * math.pi) / math.factorial(k)
             for k in degrees]  # fmt: skip
    about[0] = about[0] + wave.a + wave.b * (ends[:-1] + way)
    about[1] = about[1] + wave.b
    shifted = [
        sum((math.comb(n, k) * about[n] * (-way) ** (n - k) for n in range(k, DEGREE + 1)), 0.0)
        for k in degrees
    ]
    return ends[:-1], np.array(shifted)


def problems_of(motion: tuple[CamSegment, ...] | Curve) -> list[str]:
    """Return why a motion is none of a cam, which returns after one turn."""
    if isinstance(motion, Curve):
        if motion.kind != "periodic":
            return [f"the points of a cam are a curve of kind 'periodic', got '{motion.kind}'"]
        turn = motion.x[-1] - motion.x[0]
        if abs(turn - math.tau) > NOTABLE * math.tau:
            text = f"from x[0] to x[0] + 2 pi, got {motion.x[0]:.9g} to {motion.x[-1]:.9g}"
            return [f"the points of a cam go over one turn, {text}"]
        if motion.value[0] != motion.value[-1]:
            text = f"got {motion.value[0]:.9g} and {motion.value[-1]:.9g}"
            return [f"must return after a turn: the first and the last value are equal, {text}"]
        return [] if np.ptp(motion.value) else [NO_LIFT]
    if not motion:
        return ["a cam has two or more segments, as CamSegment(lift=0.02, angle=1.57), got none"]
    left = [n for n, one in enumerate(motion) if one.angle is None]
    total = math.fsum(one.angle or 0.0 for one in motion)
    if len(left) > 1:
        text = f"segments {left[0]} and {left[1]} have no angle; only one may take the rest"
        return [f"{text} of the turn"]
    if left and total >= math.tau * (1.0 - NOTABLE):
        text = f"the other segments take {_degrees(total)}, so that nothing is left of the turn"
        return [f"{text} for segment {left[0]}, which has no angle"]
    if not left and abs(total - math.tau) > NOTABLE * math.tau:
        text = f"the angles must add up to one turn, 360 degrees, got {_degrees(total)}"
        return [f"{text}; leave out the angle of one segment, which then takes the rest"]
    if motion[-1].lift != 0.0:
        text = f"must return: a turn begins at lift 0 and ends at {motion[-1].lift:.9g}"
        return [f"{text}; give the last segment lift=0"]
    return [] if any(one.lift for one in motion) else [NO_LIFT]


NO_LIFT = "must have a lift other than 0 somewhere; use kind 'motion' to hold a joint"


def _degrees(x: float) -> str:
    return f"{math.degrees(x):.6g} degrees ({x:.9g} rad)"


def pieces_of(motion: tuple[CamSegment, ...] | Curve, phase: float) -> Pieces:
    """Return the lift over one turn of the cam, which begins at the angle `phase` [rad]."""
    if isinstance(motion, Curve):
        own = motion.pieces
        return _turn(Pieces(own.places + phase, own.powers, motion.value[-1], True))
    rest = math.tau - math.fsum(one.angle or 0.0 for one in motion)
    begin, low = phase, 0.0
    places, powers = list[Array](), list[Array]()
    for one in motion:
        angle, rise = one.angle or rest, one.lift - low
        at, own = rise_of(one.law)
        own = rise * own / angle ** np.arange(DEGREE + 1.0)[:, None]
        own[0] += low
        places.append(begin + angle * at)
        powers.append(own)
        begin, low = begin + angle, one.lift
    ends = np.append(np.concatenate(places), begin)
    return _turn(Pieces(ends, np.hstack(powers), low, True))


def _turn(lift: Pieces) -> Pieces:
    """Return a lift stretched by its rounding, so that it takes one turn."""
    first, last = lift.places[[0, -1]]
    share = (last - first) / math.tau
    places = first + (lift.places - first) / share
    places[-1] = first + math.tau
    degrees = np.arange(float(len(lift.powers)))[:, None]
    return lift._replace(places=places, powers=lift.powers * share**degrees)


def values(lift: Pieces, x: Array) -> tuple[Array, Array, Array]:
    """Return f, f' and f'' of a lift at angles x of the cam."""
    places = lift.places
    x = places[0] + np.mod(x - places[0], math.tau)
    piece = np.clip(np.searchsorted(places, x, "right") - 1, 0, len(places) - 2)
    s = x - places[piece]
    f, slope, bend = (np.zeros(np.shape(x)) for _ in range(3))
    for c in lift.powers[::-1, piece]:
        bend = bend * s + 2.0 * slope
        slope = slope * s + f
        f = f * s + c
    return f, slope, bend


# -- geometry --------------------------------------------------------------------------------------


class Rule(NamedTuple):
    """The lengths of a cam [m], of which the arm and the distance are those of a follower that
    turns."""

    follower: Follower
    base: float
    roller: float = 0.0
    eccentricity: float = 0.0
    arm: float = 0.0
    distance: float = 0.0

    @property
    def prime(self) -> float:
        """The least distance of a knife edge or of the centre of a roller from the axis."""
        return self.base + self.roller

    @property
    def turns(self) -> bool:
        """Check whether the follower turns about a pivot."""
        return self.distance > 0.0


class Riding(NamedTuple):
    """The contact of a follower with its cam, at each of n positions."""

    contact: Points  # the point of contact, beside the cam as it has turned
    normal: Points  # the unit normal of the profile, towards the follower
    pressure: Array  # [rad] angle from the motion of the follower to the normal, counter-clockwise
    lever: Array  # force of the joint over that along the motion: 1, or the arm [m]
    margin: Array  # positive if a profile exists: the follower is not larger than its curvature


def riding(rule: Rule, f: Array, slope: Array, bend: Array) -> Riding:
    """Return where a follower touches, from its lift and two derivatives by the cam's angle."""
    with np.errstate(all="ignore"):
        return (_turning if rule.turns else _sliding)(rule, f, slope, bend)


def _sliding(rule: Rule, f: Array, slope: Array, bend: Array) -> Riding:
    one = np.ones_like(f)
    if rule.follower == "flat":
        contact = slope + 1j * (rule.base + f)
        return Riding(contact, 1j * one, 0.0 * one, one, (rule.base + f + bend) / rule.base)
    rest = math.sqrt(rule.prime**2 - rule.eccentricity**2)
    w = rule.eccentricity + 1j * (rest + f)
    found = _touching(rule, w, 1j * slope, 1j * bend, 1j * one, one)
    return found._replace(margin=np.minimum(found.margin, (rest + f) / rest))


def _turning(rule: Rule, f: Array, slope: Array, bend: Array) -> Riding:
    a, b, r = rule.distance, rule.arm, rule.prime
    angle = f + rest_angle(rule)
    pivot, along = 1j * a, -1j * np.exp(1j * angle)
    if rule.follower != "flat":
        w = pivot + b * along
        w1 = 1j * slope * (w - pivot)
        w2 = (1j * bend - slope**2) * (w - pivot)
        found = _touching(rule, w, w1, w2, 1j * along, np.full_like(f, b))
        ahead = np.cos(found.pressure)  # otherwise it jams
        margin = np.minimum(found.margin, np.minimum(ahead, np.sin(angle) * a * b / r**2))
        return found._replace(margin=margin)
    ahead = 1.0 - slope
    lever = a * np.cos(angle) / ahead
    slip = a * (np.cos(angle) * bend / ahead - np.sin(angle) * slope) / ahead
    curved = (slip + a * np.sin(angle)) / ahead
    margin = np.minimum(curved / r, np.minimum(ahead, np.cos(angle)))
    return Riding(pivot + lever * along, 1j * along, np.zeros_like(f), lever, margin)


def rest_angle(rule: Rule) -> float:
    """Return the angle of an arm, or of a face, from the line of the axes at lift 0 [rad]."""
    if rule.follower == "flat":
        return math.asin(rule.base / rule.distance)
    a, b, r = rule.distance, rule.arm, rule.prime
    return math.acos((a * a + b * b - r * r) / (2.0 * a * b))


def _touching(rule: Rule, w: Points, w1: Points, w2: Points, ahead: Points, lever: Array) -> Riding:
    """Return where a knife edge or a roller at w touches, which moves along `ahead`."""
    tangent, curved = w1 - 1j * w, w2 - 2j * w1 - w
    size = np.abs(tangent)
    normal = 1j * tangent / size
    curvature = -np.imag(np.conj(tangent) * curved) / size**3
    pressure = np.angle(normal * np.conj(ahead))
    return Riding(w - rule.roller * normal, normal, pressure, lever, 1.0 - rule.roller * curvature)


def profile(rule: Rule, lift: Pieces, count: int) -> Points:
    """Return points of the profile, counter-clockwise, of a cam that has not turned."""
    angle = lift.places[0] + math.tau * np.arange(count) / count
    return (np.exp(-1j * angle) * riding(rule, *values(lift, angle)).contact)[::-1]


def outline(rule: Rule, lift: Pieces, count: int) -> Points:
    """Return points of the follower that touch the cam, at lift 0: of a roller all around."""
    if rule.follower == "flat":
        angle = np.append(math.tau * np.arange(count * SPLIT) / (count * SPLIT), 0.0)
        found = riding(rule, *values(lift, angle))
        if not rule.turns:
            return np.array([found.contact.real.min(), found.contact.real.max()]) + 1j * rule.base
        along = -1j * np.exp(1j * rest_angle(rule))
        return 1j * rule.distance + along * np.array([found.lever.min(), found.lever.max()])
    centre = rule.eccentricity + 1j * math.sqrt(rule.prime**2 - rule.eccentricity**2)
    if rule.turns:
        centre = 1j * (rule.distance - rule.arm * np.exp(1j * rest_angle(rule)))
    if rule.follower == "knife":
        return np.array([centre])
    return centre + rule.roller * np.exp(1j * math.tau * np.arange(count) / count)


def extruded(profile: Array, width: Array) -> Array | None:
    """Return the triangles (n, 3, 3) of a solid between a profile and its copy a width (3,) away.

    None, if the origin does not see the whole profile (m, 3), which is counter-clockwise about the
    width.
    """
    after = np.roll(profile, -1, axis=0)
    if not (np.cross(profile, after) @ width > 0.0).all():
        return None
    none = np.zeros_like(profile)
    corners = (
        (none, after, profile),
        (none + width, profile + width, after + width),
        (profile, after, after + width),
        (profile, after + width, profile + width),
    )
    return np.concatenate([np.stack(one, axis=1) for one in corners])


def lowest(rule: Rule, lift: Pieces, ends: Sequence[float]) -> tuple[float, float]:
    """Return (angle [rad], margin) where the margin is least, between the ends of segments."""
    return least(lambda x: _margins(rule, values(lift, x)), _between(ends, SPLIT))


def _between(ends: Sequence[float], parts: int) -> Array:
    """Return angles that divide each segment into equal parts, and the last end."""
    at, share = np.asarray(ends), np.linspace(0.0, 1.0, parts, endpoint=False)
    return np.append((at[:-1, None] + np.diff(at)[:, None] * share).ravel(), at[-1])


def _margins(rule: Rule, moved: tuple[Array, Array, Array]) -> Array:
    """Return the margins, negative where there is no position."""
    found = riding(rule, *moved).margin
    return np.where(np.isnan(found), -1.0, found)


CANDIDATES = 128  # base radii that are tried before bisection


def enough(
    rule: Rule, lift: Pieces, ends: Sequence[float], most: float, reaches: Callable[[float], bool]
) -> float | None:
    """Return the least base radius [m] up to `most` that works, of four digits, or None.

    `reaches` checks whether the follower reaches the circle of a base radius.
    """
    moved = values(lift, _between(ends, SPLIT))

    def works(base: float) -> bool:
        other = rule._replace(base=base)
        if not reaches(base) or not (_margins(other, moved) > 0.0).all():
            return False  # seen without a search
        return lowest(other, lift, ends)[1] > 0.0

    low = rule.base
    for high in np.geomspace(low, most, CANDIDATES)[1:].tolist():
        if works(high):
            break
        low = high
    else:
        return None
    while high - low > NOTABLE * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if works(middle) else (middle, high)
    found = rounded_up(high)
    return found if works(found) else None


def rounded_up(x: float) -> float:
    """Return a number > 0 of four digits that is not less than x > 0."""
    unit = 10.0 ** (math.floor(math.log10(x)) - 3)
    return float(f"{math.ceil(x / unit) * unit:.4g}")

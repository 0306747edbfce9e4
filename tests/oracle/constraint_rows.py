"""Residuals, Jacobians and J'θ' of every kind of constraint, from the paper's dense operators.

An oracle that shares nothing with the kernels. Relative motion is as seen by an observer on
`other`: v_rel = v_a - v_b*, a_rel = a_a - a_b* - 2 ω_b × v_rel, with b* the point of `other` at
the same place.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.optimize import brentq

from pgraph_core import joints
from pgraph_core.model import Constraint, Curve, Polynomial, Sine, Table
from pgraph_core.paper import Operators, v_slices
from pgraph_core.rotation import Array, unit_vector


class Rows(NamedTuple):
    """The rows of one constraint, angular ones times a length, so that residuals are lengths."""

    residual: Array  # (m,) position level, 0 for rows of velocities alone
    J: Array  # (m, nv)
    drift: Array  # (m,) J'θ', and what a prescribed motion adds: rows ask J θ'' + drift = 0
    speed: Array  # (m,) rows ask J θ' = speed
    wrench: Array  # (m, 6) [torque, force] on `body` at `point` of a unit multiplier, world axes


def rows_of(op: Operators, c: Constraint, length: float, t: float = 0.0) -> Rows:
    """Return the rows of a constraint at the state of `op`, with `length` [m] per radian."""
    return _KINDS[c.kind](_Pair(op, c, length, t))


def radius_of_gyration(op: Operators) -> float:
    """Return the radius of gyration of all moving bodies about their origins [m], or 1."""
    parent = op.topology.parent
    moves = [False]  # the ground, then each body
    for body, above in zip(op.bodies, parent):
        moves.append(body.dof > 0 or moves[above])
    bodies = [body for body, moving in zip(op.bodies, moves[1:]) if moving]
    moment = sum(np.trace(b.inertia) / 2 + b.mass * np.dot(b.com, b.com) for b in bodies)
    mass = sum(b.mass for b in bodies)
    return float(np.sqrt(moment / mass)) if mass > 0 and moment > 0 else 1.0


def points_of(op: Operators, c: Constraint) -> tuple[Array, Array]:
    """Return the two points in their bodies' frames, by default coincident at home."""
    body, other = map(op.topology.number, c.pair)
    point = np.array(op.model.point_of(c))
    given = getattr(c, "other_point", None)
    if given is not None or c.kind == "rolling":
        return point, np.array(given or (0.0, 0.0, 0.0))
    position, rotation = op.home
    at = position[body - 1] + rotation[body - 1] @ point
    return point, rotation[other - 1].T @ (at - position[other - 1]) if other else at


class _End:
    """A point of a body (0: the ground) and how it moves, world axes."""

    def __init__(self, op: Operators, number: int, x: Array):
        self.x = x
        if number == 0:
            self.J, self.bias, self.omega = np.zeros((6, op.nv)), np.zeros(6), np.zeros(3)
            return
        point = op.rotation[number - 1].T @ (x - op.position[number - 1])
        self.J, self.bias = op.point_jacobian(number, point), op.point_bias(number, point)
        self.omega = op.omega(number)


class _Pair:
    """`body` at its point, and `other` both at its own point and at the place of the first."""

    def __init__(self, op: Operators, c: Any, length: float, t: float):
        self.op, self.c, self.length, self.t = op, c, length, t
        self.a, self.b = map(op.topology.number, c.pair)
        self.point, self.other_point = points_of(op, c)
        self.R_a, self.R_b = _rotation(op.rotation, self.a), _rotation(op.rotation, self.b)
        home = op.home[1]
        self.home = _rotation(home, self.b).T @ _rotation(home, self.a)  # axes of a to those of b
        self.x_a = op.point_position(self.a, self.point)
        self.x_b = op.point_position(self.b, self.other_point) if self.b else self.other_point

    @cached_property
    def end(self) -> _End:
        """`point`."""
        return _End(self.op, self.a, self.x_a)

    @cached_property
    def here(self) -> _End:
        """Material point of `other` at the place of `point`."""
        return _End(self.op, self.b, self.x_a)

    @cached_property
    def far(self) -> _End:
        """`other_point`."""
        return _End(self.op, self.b, self.x_b)

    def axes(self) -> tuple[Array, Array]:
        """(axis, other_axis) in their bodies' axes."""
        c = self.c
        other = getattr(c, "other_axis", None)  # a skate has none
        if c.axis is not None:
            axis = unit_vector(c.axis)
            return axis, self.home @ axis if other is None else unit_vector(other)
        if other is not None:
            return self.home.T @ unit_vector(other), unit_vector(other)
        if c.kind == "universal":
            return np.array([0.0, 1.0, 0.0]), self.home @ [1.0, 0.0, 0.0]
        return np.array([0.0, 0.0, 1.0]), self.home @ [0.0, 0.0, 1.0]

    def relative(self) -> tuple[Array, Array, Array]:
        """J, velocity and acceleration at θ'' = 0 of `point` as seen from `other`."""
        J = self.end.J[3:] - self.here.J[3:]
        v = J @ self.op.speeds
        spin = np.cross(self.here.omega, v)
        return J, v, self.end.bias[3:] - self.here.bias[3:] - 2 * spin

    def spin(self) -> tuple[Array, Array, Array]:
        """J, velocity and acceleration at θ'' = 0 of the turning as seen from `other`."""
        J = self.end.J[:3] - self.here.J[:3]
        turning = np.cross(self.here.omega, self.end.omega)
        return J, J @ self.op.speeds, self.end.bias[:3] - self.here.bias[:3] - turning

    def together(self) -> Rows:
        """x_a = x_b, in world axes and each end at its own point."""
        J = self.end.J[3:] - self.far.J[3:]
        drift = self.end.bias[3:] - self.far.bias[3:]
        return Rows(self.x_a - self.x_b, J, drift, np.zeros(3), _wrench(force=np.eye(3)))

    def held(self, dirs: Array) -> Rows:
        """d · (x_a - x_b) = 0 for directions fixed in `other`, given in its axes."""
        d = np.atleast_2d(dirs) @ self.R_b.T
        J, _, bias = self.relative()
        zero = np.zeros(len(d))
        return Rows(d @ (self.x_a - self.x_b), d @ J, d @ bias, zero, _wrench(force=d))

    def normal(self, axes: Array, others: Array) -> Rows:
        """a · b = 0 for pairs of directions fixed in the two bodies, times the length."""
        a, b = np.atleast_2d(axes) @ self.R_a.T, np.atleast_2d(others) @ self.R_b.T
        J, omega, bias = self.spin()
        about = np.cross(a, b) * self.length
        bent = np.cross(np.cross(omega, a), b) * self.length  # as seen from `other`
        drift = about @ bias + bent @ omega
        residual = (a * b).sum(axis=1) * self.length
        return Rows(residual, about @ J, drift, np.zeros(len(a)), _wrench(torque=about))

    def slipping(self, arm: Array, rate: Array, w: Array, gap: float) -> Rows:
        """Return the velocity at `point` + arm along w fixed in `other`, with the arm's `rate`."""
        J, _, bias = self.relative()
        turn, omega, turn_bias = self.spin()
        J = J - np.cross(arm, turn.T).T
        bias = bias + np.cross(turn_bias, arm) + np.cross(omega, rate)
        residual = np.array([gap, 0.0, 0.0])
        at_point = _wrench(torque=np.cross(arm, w), force=w)
        return Rows(residual, w @ J, w @ bias, np.zeros(3), at_point)

    def coordinates(self, terms: dict[str, Array]) -> tuple[Array, Array]:
        """(1, nv) and (1, 6): coefficients on θ', and the joint's own share as a wrench."""
        J, wrench = np.zeros((1, self.op.nv)), np.zeros((1, 6))
        for name, factors in terms.items():
            number = self.op.topology.number(name)
            J[0, v_slices(self.op.bodies)[number - 1]] += factors
            if number == self.a:
                H = self.op.joint(number).H
                turns = np.linalg.norm(H[:3], axis=0) > 0.5
                wrench[0, :3] += H[:3] @ (factors * turns)
                wrench[0, 3:] += H[3:] @ (factors * ~turns)
        return J, wrench

    def coordinate(self, name: str, k: int | None, factor: float) -> tuple[float, Array]:
        """q of a coordinate with a position, and its coefficients on the joint's θ'."""
        body = self.op.model.body(name)
        position = _positions(self.op, name)[k or 0]
        return position, factor * np.eye(body.dof)[k or 0]


def _positions(op: Operators, name: str) -> list[float]:
    """Return q by degree of freedom, nan for those of balls."""
    number = op.topology.number(name)
    start = sum(len(body.q) for body in op.bodies[: number - 1])
    found: list[float] = []
    for motion in op.bodies[number - 1].sequence:
        nq, nv = joints.SIZE[motion.kind]
        found += [float(op.q[start])] if nv == 1 else [np.nan] * nv
        start += nq
    return found


def _rotation(rotation: Array, number: int) -> Array:
    return rotation[number - 1] if number else np.eye(3)


def _beside(axis: Array) -> Array:
    """(2, 3) an orthonormal basis of what is normal to an axis."""
    return np.linalg.svd(axis[None])[2][1:]


def _wrench(torque: Array | None = None, force: Array | None = None) -> Array:
    given = force if torque is None else torque
    zero = np.zeros_like(given)
    return np.hstack((zero if torque is None else torque, zero if force is None else force))


def _together(*parts: Rows) -> Rows:
    return Rows(*(np.concatenate(columns) for columns in zip(*parts)))


def _upright(p: _Pair) -> Rows:
    """Orientation as at home: columns of R_a against those of R_b, in pairs."""
    at_home = p.home.T
    pairs = ((1, 2), (2, 0), (0, 1))
    return p.normal(np.array([at_home[:, s] for s, _ in pairs]), np.eye(3)[[t for _, t in pairs]])


def _revolute(p: _Pair) -> Rows:
    axis, other = p.axes()
    return _together(p.together(), p.normal(np.tile(axis, (2, 1)), _beside(other)))


def _cylindrical(p: _Pair) -> Rows:
    axis, other = p.axes()
    return _together(p.normal(np.tile(axis, (2, 1)), _beside(other)), p.held(_beside(other)))


def _universal(p: _Pair) -> Rows:
    axis, other = p.axes()
    return _together(p.together(), p.normal(axis, other))


def _distance(p: _Pair) -> Rows:
    apart = p.x_a - p.x_b
    now, length = float(np.linalg.norm(apart)), p.c.length
    if length is None:
        position, rotation = p.op.home
        a = position[p.a - 1] + rotation[p.a - 1] @ p.point
        b = position[p.b - 1] + rotation[p.b - 1] @ p.other_point if p.b else p.other_point
        length = float(np.linalg.norm(a - b))
    u = apart / now
    J = p.end.J[3:] - p.far.J[3:]
    v = J @ p.op.speeds
    drift = u @ (p.end.bias[3:] - p.far.bias[3:]) + (v @ v - (u @ v) ** 2) / now
    one = np.zeros(1)
    return Rows(np.array([now - length]), (u @ J)[None], one + drift, one, _wrench(force=u[None]))


def _rolling(p: _Pair) -> Rows:
    c, shape = p.c, p.op.bodies[p.a - 1].shape
    normal = p.op.model.ground_normal if p.b == 0 else (0.0, 0.0, 1.0)
    fixed = unit_vector(c.other_axis or normal)
    w = np.vstack((fixed, _beside(fixed))) @ p.R_b.T
    n = w[0]
    radius = c.radius or (shape.radius if shape and shape.radius else 0.0)
    height = float(n @ (p.x_a - p.x_b))
    if c.axis is None:
        return p.slipping(-radius * n, np.zeros(3), w, height - radius)
    axis = p.R_a @ unit_vector(c.axis)
    across = n - (n @ axis) * axis  # towards the highest point of the rim
    u = unit_vector(across)
    turned = np.cross(p.spin()[1], axis)
    rate = -(n @ turned) * axis - (n @ axis) * turned
    rate = (rate - (u @ rate) * u) / np.linalg.norm(across)
    gap = height - radius * float(np.linalg.norm(across))
    return p.slipping(-radius * u, -radius * rate, w, gap)


def _skate(p: _Pair) -> Rows:
    a = p.R_a @ p.axes()[0]
    J, v, bias = p.relative()
    drift = a @ bias + np.cross(p.spin()[1], a) @ v
    one = np.zeros(1)
    return Rows(one, (a @ J)[None], one + drift, one, _wrench(force=a[None]))


def _gear(p: _Pair) -> Rows:
    c, zero = p.c, np.zeros(1)
    ratio = 1.0 if c.ratio is None else c.ratio
    own, factors = p.coordinate(c.body, c.coordinate, 1.0)
    driver, others = p.coordinate(c.other, c.other_coordinate, -ratio)
    J, wrench = p.coordinates({c.body: factors, c.other: others})
    return Rows(zero + own - ratio * driver - (c.offset or 0.0), J, zero, zero, wrench)


def _relation(p: _Pair) -> Rows:
    c, zero = p.c, np.zeros(1)
    own, factors = p.coordinate(c.body, c.coordinate, 1.0)
    x, ones = p.coordinate(c.other, c.other_coordinate, 1.0)
    f, slope, bend = related(c.curve, x)
    J, wrench = p.coordinates({c.body: factors, c.other: -slope * ones})
    rate = float(p.coordinates({c.other: ones})[0][0] @ p.op.speeds)
    return Rows(zero + own - f, J, zero - bend * rate**2, zero, wrench)


def related(curve: Curve | Polynomial, x: float) -> tuple[float, float, float]:
    """Return f, f' and f'' of a periodic or quintic spline, or of a polynomial."""
    if isinstance(curve, Polynomial):
        f = np.polynomial.Polynomial(curve.coefficients)
        return float(f(x)), float(f.deriv(1)(x)), float(f.deriv(2)(x))
    places, value = np.array(curve.x), np.array(curve.value)
    if curve.kind == "quintic":
        if not places[0] <= x <= places[-1]:
            return float(value[0] if x < places[0] else value[-1]), 0.0, 0.0
        rest = [(1, 0.0), (2, 0.0)]
        spline = make_interp_spline(places, value, k=5, bc_type=(rest, rest))
        return float(spline(x)), float(spline(x, 1)), float(spline(x, 2))
    assert curve.kind == "periodic"
    rise = (value[-1] - value[0]) / (places[-1] - places[0])
    rest = value - rise * places
    rest[-1] = rest[0]
    spline = CubicSpline(places, rest, bc_type="periodic")
    return float(spline(x) + rise * x), float(spline(x, 1) + rise), float(spline(x, 2))


def _motion(p: _Pair) -> Rows:
    own, factors = p.coordinate(p.c.body, p.c.coordinate, 1.0)
    J, wrench = p.coordinates({p.c.body: factors})
    q, v, vdot = prescribed(p.c.q_of_t, p.t)
    return Rows(np.array([own - q]), J, np.array([-vdot]), np.array([v]), wrench)


def prescribed(q_of_t: Table | Sine | Polynomial | None, t: float) -> tuple[float, float, float]:
    """Return q, q', q'' of a prescribed motion. A table is a spline at rest at its ends."""
    match q_of_t:
        case Sine(mean=mean, amplitude=size, frequency=w, phase=phase):
            angle = w * t + phase
            sine, cosine = size * np.sin(angle), size * np.cos(angle)
            return mean + sine, w * cosine, -w * w * sine
        case Polynomial(coefficients=c):
            f = np.polynomial.Polynomial(c)
            return float(f(t)), float(f.deriv(1)(t)), float(f.deriv(2)(t))
        case Table(t=times, value=value):
            if not times[0] <= t < times[-1]:
                return float(value[0] if t < times[0] else value[-1]), 0.0, 0.0
            spline = CubicSpline(times, value, bc_type="clamped")
            return float(spline(t)), float(spline(t, 1)), float(spline(t, 2))
    raise ValueError(q_of_t)


def _velocity(p: _Pair) -> Rows:
    terms = {name: np.array(x) for name, x in (p.c.coefficients or {}).items()}
    J, wrench = p.coordinates(terms)
    zero = np.zeros(1)
    return Rows(zero, J, zero, zero + (p.c.value or 0.0), wrench)


def _curve_point(p: _Pair) -> Rows:
    """Rows of a flat curve through points: along its plane's normal, and along that of the curve.

    The nearest place is sought by SciPy, on the spline of degree 5 over the lengths of chords.
    """
    c, points = p.c.curve, np.array(p.c.curve.points)
    points = np.vstack((points, points[:1])) if c.closed else points
    u = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    free = [(3, np.zeros(3)), (4, np.zeros(3))]
    spline = make_interp_spline(u, points, k=5, bc_type="periodic" if c.closed else (free, free))
    x = p.R_b.T @ (p.x_a - (p.op.position[p.b - 1] if p.b else 0.0))
    ways = np.linspace(u[0], u[-1], 2000)
    k = int(np.argmin(np.linalg.norm(spline(ways) - x, axis=1)))
    place = brentq(
        lambda s: spline(s, 1) @ (x - spline(s)), ways[max(k - 1, 0)], ways[min(k + 1, 1999)],
        xtol=1e-15,
    )  # fmt: skip
    apart, slope, bend = x - spline(place), spline(place, 1), spline(place, 2)
    t = slope / np.linalg.norm(slope)
    normal = np.linalg.svd(np.diff(points, axis=0))[2][2]
    n = np.array((np.cross(normal, t), normal))
    J, v, bias = p.relative()
    seen = p.R_b.T @ v
    spin = np.cross(t, bend) * (t @ seen) / (slope @ slope - apart @ bend)
    drift = n @ p.R_b.T @ bias + np.cross(spin, n) @ seen
    d = n @ p.R_b.T
    return Rows(n @ apart, d @ J, drift, np.zeros(2), _wrench(force=d))


_KINDS: dict[str, Callable[[_Pair], Rows]] = {
    "point": lambda p: p.together(),
    "weld": lambda p: _together(p.together(), _upright(p)),
    "revolute": _revolute,
    "prismatic": lambda p: _together(_upright(p), p.held(_beside(p.axes()[1]))),
    "cylindrical": _cylindrical,
    "universal": _universal,
    "distance": _distance,
    "line": lambda p: p.held(_beside(p.axes()[1])),
    "curve_point": _curve_point,
    "plane": lambda p: p.held(p.axes()[1]),
    "orientation": _upright,
    "gear": _gear,
    "relation": _relation,
    "motion": _motion,
    "rolling": _rolling,
    "skate": _skate,
    "velocity": _velocity,
}

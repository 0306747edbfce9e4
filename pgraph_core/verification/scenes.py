"""Random scenes, ordinary and extreme, whose motion is known without this package.

Each family draws a model over scales of mass, length, time and stiffness, with the closed form of
its motion, or none where a far finer run by another method is the judge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..model import Body, Contact, Model, Motor, Table
from ..packing.system import Array

Rng = np.random.Generator
NONE = np.zeros((3, 3))  # inertia of a point mass
SMOOTH: tuple[dict[str, Any], ...] = (
    {"method": "dopri5", "rtol": 1e-6}, {"method": "dop853", "rtol": 1e-10},
    {"method": "dop853", "rtol": 1e-4}, {"method": "radau5", "rtol": 1e-6},
    {"method": "ros2", "rtol": 1e-4}, {"method": "rk4", "parts": 100},
    {"method": "rk4", "parts": 1000}, {"method": "semi_implicit_euler", "parts": 1000},
    {"method": "radau5", "parts": 100}, {"method": "dop853", "parts": 20},
)  # fmt: skip
TOUCHING: tuple[dict[str, Any], ...] = ({"rtol": 1e-8}, {"method": "rk4", "parts": 500})


JOINTS = {
    "revolute": (1, 0), "prismatic": (0, 1), "universal": (2, 0), "spherical": (3, 0),
    "cylindrical": (1, 1),
}  # fmt: skip


class Scene(NamedTuple):
    """A run whose motion is known."""

    family: str
    what: str  # its numbers
    model: Model
    t_end: float
    known: Callable[[Array], Array] | None  # q (n, nq) at times (n,); None: a finer run knows
    others: tuple[dict[str, Any], ...] = SMOOTH  # settings besides the default


def scenes(count: int, seed: int) -> Iterator[Scene]:
    """`count` scenes, the families in turn; a scene depends on the seed and its number only."""
    families = list(FAMILIES.values())
    for k in range(count):
        yield families[k % len(families)](np.random.default_rng([seed, k]))


def _scale(rng: Rng, least: float, most: float) -> float:
    """A number whose logarithm is uniform."""
    return float(10.0 ** rng.uniform(np.log10(least), np.log10(most)))


def _numbers(**given: float) -> str:
    return ", ".join(f"{name}={value:.4g}" for name, value in given.items())


# -- one degree of freedom -----------------------------------------------------------------------


def oscillator(rng: Rng) -> Scene:
    """A slider or a hinge on its spring, from undamped to overdamped."""
    m, w, size = _scale(rng, 1e-9, 1e9), _scale(rng, 1e-4, 1e4), _scale(rng, 1e-6, 1e3)
    zeta = float(rng.choice([0.0, 0.1, 0.9, 2.0, 30.0, _scale(rng, 1e-3, 1e3)]))
    hinge = bool(rng.random() < 0.5)
    size = min(size, 1.0) if hinge else size
    joint: dict[str, Any] = {"joint": "revolute" if hinge else "prismatic"}
    joint["inertia"] = np.eye(3) * m if hinge else NONE
    body = Body(
        name="b", mass=m, stiffness=m * w * w, damping=2 * zeta * m * w, q=(size,),
        axes=((0, 0, 1),), **joint,
    )  # fmt: skip

    def known(t: Array) -> Array:
        root = np.sqrt(complex(zeta * zeta - 1.0)) + 1e-9j
        a = w * (-zeta + root)
        b = w * w / a  # the product of the roots, without cancellation
        x = (a * np.exp(b * t) - b * np.exp(a * t)) / (a - b)
        return (size * x.real)[:, None]

    span = _scale(rng, 0.1, 30.0) / w
    return Scene(
        "oscillator", _numbers(m=m, w=w, zeta=zeta, x=size), _free_model(body), span, known
    )


def pendulum(rng: Rng) -> Scene:
    """A point mass from rest, by elliptic functions."""
    from scipy.special import ellipj, ellipk

    length, m, g = _scale(rng, 1e-6, 1e6), _scale(rng, 1e-9, 1e9), _scale(rng, 1e-3, 1e3)
    angle = float(rng.uniform(0.01, 3.1))
    body = Body(name="b", mass=m, com=(0, 0, -length), inertia=NONE, axes=((0, 1, 0),), q=(angle,))
    w, k = np.sqrt(g / length), np.sin(angle / 2)

    def known(t: Array) -> Array:
        sn, *_ = ellipj(ellipk(k * k) + w * t, k * k)
        return (2 * np.arcsin(k * sn))[:, None]

    span = _scale(rng, 0.1, 20.0) / w
    model = Model(bodies=(body,), gravity=(0, 0, -g))
    return Scene("pendulum", _numbers(m=m, l=length, g=g, angle=angle), model, span, known)


def pulse(rng: Rng) -> Scene:
    """A motor that pushes for a short while: a table with four knots."""
    m, total, push = _scale(rng, 1e-3, 1e3), _scale(rng, 1e-2, 1e2), _scale(rng, 1e-3, 1e3)
    wide, at, rise = _scale(rng, 1e-4, 0.3), float(rng.uniform(0.1, 0.6)), 1e-6
    knots = total * np.array([0.0, at, at + rise, at + rise + wide, at + 2 * rise + wide, 1.0])
    torque = push * m / (wide * total) / total
    table = Table(t=tuple(knots.tolist()), value=(0.0, 0.0, torque, torque, 0.0, 0.0))
    body = Body(name="b", joint="prismatic", mass=m, inertia=NONE, axes=((1, 0, 0),))
    model = Model(
        bodies=(body,), gravity=(0, 0, 0), forces=(Motor(name="f", body="b", torque=table),)
    )

    def known(t: Array) -> Array:
        fine = np.union1d(t, knots)
        force = np.interp(fine, knots, table.value) / m
        h = np.diff(fine)
        v = np.append(0.0, np.cumsum(0.5 * h * (force[1:] + force[:-1])))
        x = np.append(0.0, np.cumsum(h * v[:-1] + h * h * (2 * force[:-1] + force[1:]) / 6))
        return x[np.searchsorted(fine, t)][:, None]

    return Scene("pulse", _numbers(m=m, t=total, wide=wide, at=at), model, total, known)


def flight(rng: Rng) -> Scene:
    """A free body thrown, which spins about a principal axis."""
    m, speed, spin = _scale(rng, 1e-9, 1e9), _scale(rng, 1e-6, 1e4), _scale(rng, 1e-6, 1e3)
    size, g, span = _scale(rng, 1e-6, 1e3), _scale(rng, 1e-3, 1e3), _scale(rng, 1e-2, 10.0)
    axis, way = int(rng.integers(3)), rng.normal(size=3)
    principal = m * size**2 * np.array([1.0, 1.4, 1.9])
    v = np.zeros(6)
    v[axis], v[3:] = spin, speed * way
    body = Body(name="b", joint="free", mass=m, inertia=np.diag(principal), v=tuple(v.tolist()))

    def known(t: Array) -> Array:
        q = np.zeros((len(t), 7))
        q[:, :3] = np.outer(t, v[3:])
        q[:, 2] -= 0.5 * g * t * t
        q[:, 3], q[:, 4 + axis] = np.cos(0.5 * spin * t), np.sin(0.5 * spin * t)
        return q

    span = min(span, 300.0 / spin)
    model = Model(bodies=(body,), gravity=(0, 0, -g))
    return Scene("flight", _numbers(m=m, v=speed, spin=spin, r=size, g=g), model, span, known)


# -- contacts and limits -------------------------------------------------------------------------


def bounce(rng: Rng) -> Scene:
    """A ball dropped on hard ground."""
    r, m, g = _scale(rng, 1e-4, 1e2), _scale(rng, 1e-6, 1e6), _scale(rng, 1e-1, 1e2)
    h, e = r * _scale(rng, 0.1, 1e2), float(rng.choice([0.0, 0.3, 0.5, 0.8, 0.95, 1.0]))
    body = Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), mass=m, q=(r + h,), inertia=NONE,
        shape={"kind": "sphere", "radius": r},
    )  # fmt: skip
    floor = Contact(name="c", body="b", law="complementarity", restitution=e, friction=0.0)
    model = Model(bodies=(body,), contacts=(floor,), gravity=(0, 0, -g))
    fall = np.sqrt(2 * h / g)
    span = fall * float(rng.uniform(0.5, 6.0))

    def known(t: Array) -> Array:
        x, v = np.zeros(len(t)), 0.0
        place, begin = h, 0.0
        ends = fall
        for _ in range(2000):
            now = (t >= begin) & (t < ends)
            x[now] = place + v * (t[now] - begin) - 0.5 * g * (t[now] - begin) ** 2
            v = e * (g * (ends - begin) - v)
            place, begin = 0.0, ends
            ends = begin + 2 * v / g
            if begin > t[-1] or v < 1e-12 * np.sqrt(g * h):
                break
        return (r + x)[:, None]

    return Scene("bounce", _numbers(r=r, m=m, g=g, h=h, e=e), model, span, known, TOUCHING)


def slide(rng: Rng) -> Scene:
    """A block pushed over the ground until friction stops it, or a ball until it rolls."""
    m, g, mu = _scale(rng, 1e-6, 1e6), _scale(rng, 1e-1, 1e2), _scale(rng, 1e-2, 2.0)
    r, v0 = _scale(rng, 1e-3, 1e2), _scale(rng, 1e-2, 1e2)
    ball = bool(rng.random() < 0.5)
    floor = Contact(name="c", body="b", law="complementarity", friction=mu, restitution=0.0)
    stop = (2 / 7 if ball else 1.0) * v0 / (mu * g)
    span = stop * float(rng.uniform(0.3, 3.0))
    if ball:
        body = Body(
            name="b", joint="free", mass=m, inertia=np.eye(3) * (0.4 * m * r * r),
            q=(0, 0, r, 1, 0, 0, 0), v=(0, 0, 0, v0, 0, 0), shape={"kind": "sphere", "radius": r},
        )  # fmt: skip
    else:
        body = Body(
            name="b", joint="compound", mass=m, v=(v0, 0.0), inertia=NONE,
            motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        )  # fmt: skip
        floor = floor.model_copy(update={"points": ((0.0, 0.0, 0.0),)})
    model = Model(bodies=(body,), contacts=(floor,), gravity=(0, 0, -g))

    def known(t: Array) -> Array:
        s = np.minimum(t, stop)
        x = v0 * s - 0.5 * mu * g * s * s
        if not ball:
            return np.column_stack((x, 0 * x))
        x = x + 5 / 7 * v0 * (t - s)
        angle = (1.25 * mu * g * s * s + 5 / 7 * v0 * (t - s)) / r
        q = np.zeros((len(t), 7))
        q[:, 0], q[:, 2] = x, r
        q[:, 3], q[:, 5] = np.cos(angle / 2), np.sin(angle / 2)
        return q

    return Scene(
        "ball" if ball else "slide", _numbers(m=m, g=g, mu=mu, r=r, v=v0), model, span, known,
        TOUCHING,
    )  # fmt: skip


def limits(rng: Rng) -> Scene:
    """A slider or hinge that flies between its limits."""
    m, size, speed = _scale(rng, 1e-6, 1e6), _scale(rng, 1e-3, 1e3), _scale(rng, 1e-3, 1e3)
    e = float(rng.choice([0.0, 0.5, 0.9, 1.0]))
    hinge = bool(rng.random() < 0.5)
    size = min(size, 3.0) if hinge else size
    body = Body(
        name="b", joint="revolute" if hinge else "prismatic", axes=((0, 0, 1),), mass=m,
        inertia=np.eye(3) * m, limits=((-size, size),), limit_restitution=e, v=(speed,),
    )  # fmt: skip
    span = size / speed * float(rng.uniform(0.5, 12.0))

    def known(t: Array) -> Array:
        x, place, begin, v = np.zeros(len(t)), 0.0, 0.0, speed
        while True:
            ends = begin + (size * np.sign(v) - place) / v if v != 0.0 else np.inf
            now = (t >= begin) & (t <= ends)
            x[now] = place + v * (t[now] - begin)
            if ends > t[-1]:
                return x[:, None]
            place, begin, v = size * np.sign(v), ends, -e * v

    return Scene(
        "limits", _numbers(m=m, x=size, v=speed, e=e), _free_model(body), span, known, TOUCHING
    )


def head_on(rng: Rng) -> Scene:
    """Two balls on one line that meet, a hard or a soft contact of them."""
    m1, m2 = _scale(rng, 1e-3, 1e3), _scale(rng, 1e-3, 1e3)
    r, v0, e = _scale(rng, 1e-3, 1.0), _scale(rng, 1e-2, 1e3), float(rng.uniform(0, 1))
    gap = r * _scale(rng, 0.5, 50.0)
    shape = {"kind": "sphere", "radius": r}
    line: dict[str, Any] = {
        "joint": "prismatic",
        "axes": ((1, 0, 0),),
        "shape": shape,
        "inertia": NONE,
    }
    one = Body(name="a", mass=m1, v=(v0,), **line)
    two = Body(name="b", mass=m2, link=(2 * r + gap, 0, 0), **line)
    pair = Contact(name="c", body="a", other="b", law="complementarity", restitution=e)
    model = Model(bodies=(one, two), contacts=(pair,), gravity=(0, 0, 0))
    span, hit = gap / v0 * float(rng.uniform(0.5, 5.0)), gap / v0

    def known(t: Array) -> Array:
        push = (1 + e) * v0 / (1 / m1 + 1 / m2)
        after = np.maximum(t - hit, 0.0)
        before = np.minimum(t, hit)
        return np.column_stack((v0 * before + (v0 - push / m1) * after, push / m2 * after))

    others = ({"parts": 300}, {"parts": 3000})
    return Scene(
        "head on", _numbers(m1=m1, m2=m2, r=r, v=v0, gap=gap, e=e), model, span, known, others
    )


def soft_meeting(rng: Rng) -> Scene:
    """Two soft balls that meet without losses: as hard ones after a while, or not at all."""
    scene = head_on(rng)
    model = scene.model.edit("c", law="soft", restitution=None, damping=0.0)
    return scene._replace(
        family="soft meeting", model=model, known=None,
        others=({"method": "dopri5", "rtol": 1e-5}, {"method": "dop853", "rtol": 1e-10}),
    )  # fmt: skip


# -- several bodies ------------------------------------------------------------------------------


def tree(rng: Rng) -> Scene:
    """A random tree of hinges, sliders, balls and universal joints, some of them damped."""
    count, bodies = int(rng.integers(1, 7)), []
    size, m = _scale(rng, 1e-3, 1e3), _scale(rng, 1e-6, 1e6)
    for i in range(count):
        kind = str(rng.choice(list(JOINTS)))
        turns, slides = JOINTS[kind]
        mass = m * _scale(rng, 0.1, 10.0)
        given: dict[str, Any] = {"joint": kind}
        if kind not in ("spherical", "universal"):
            given["axes"] = (tuple(rng.normal(size=3).tolist()),) * (turns + slides)
        if kind == "revolute":
            given["damping"] = (m * size**2 * float(rng.choice([0.0, 0.0, 0.3])),)
        v = (*rng.normal(0, 1, turns).tolist(), *(size * rng.normal(0, 1, slides)).tolist())
        body = Body(
            name=f"b{i}", parent="ground" if i == 0 else f"b{rng.integers(i)}",
            link=tuple((size * rng.normal(0, 0.5, 3)).tolist()), mass=mass,
            com=tuple((size * rng.normal(0, 0.3, 3)).tolist()),
            inertia=np.diag(mass * size**2 * rng.uniform(0.1, 0.17, 3)), v=v, **given,
        )  # fmt: skip
        bodies.append(body)
    model = Model(bodies=tuple(bodies), gravity=(0, 0, -10 * size))
    return Scene("tree", _numbers(n=count, l=size, m=m), model, _scale(rng, 0.1, 5.0), None)


def chaos(rng: Rng) -> Scene:
    """A double pendulum from anywhere, for long."""
    bodies = tuple(
        Body(name=f"b{i}", parent="ground" if i == 0 else "b0", axes=((0, 1, 0),), mass=1.0,
             inertia=NONE, com=(0, 0, -1), link=(0, 0, -i), q=(float(rng.uniform(-3, 3)),))
        for i in range(2)
    )  # fmt: skip
    return Scene("chaos", "", Model(bodies=bodies), float(rng.uniform(2, 30)), None)


def _free_model(*bodies: Body) -> Model:
    return Model(bodies=bodies, gravity=(0, 0, 0))


FAMILIES: dict[str, Callable[[Rng], Scene]] = {
    "oscillator": oscillator, "pendulum": pendulum, "pulse": pulse, "flight": flight,
    "bounce": bounce, "slide": slide, "limits": limits, "head on": head_on,
    "soft meeting": soft_meeting, "tree": tree, "chaos": chaos,
}  # fmt: skip

"""Friction, rolling and spinning against closed forms, next to MuJoCo.

Steps of 1 ms for both; MuJoCo with the elliptic cone, Newton's method and impratio 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import has
from .measure import Effort, Row
from .scenes import STEP

MINUTES = 0.5
PEERS = ("mujoco",)
Array = np.ndarray
Numbers = tuple[float, ...]
G, R = 9.81, 0.1
BALL, SOLID = {"kind": "sphere", "radius": R}, np.eye(3) * 0.4 * R * R
SPHERE = f'type="sphere" size="{R}"'
NONE = (0.0,) * 6


def rows(effort: Effort) -> Iterator[Row]:
    """Closed forms and errors; then motions that have none, as numbers."""
    for name, exact, mine, other in closed_forms(effort):
        theirs = None if other is None else float(other - exact)
        yield {
            "case": name, "closed form": float(exact), "error of pgraph": float(mine - exact),
            "error of MuJoCo": theirs,
        }  # fmt: skip
    if not effort.quick:
        for case, (mine, other) in (
            ("celt: spin about the vertical after 8 s [rad/s]", celt()),
            ("tippe top: relative change of Jellett's constant", jellett()),
        ):
            yield {"case": case, "pgraph": mine, "MuJoCo": other}


def closed_forms(effort: Effort) -> Iterator[tuple[str, float, float, float | None]]:
    """(case, closed form, ours, MuJoCo's)."""
    sliding, rolling, spinning = (0, 0, 0, 1.0, 0, 0), (0, 1 / R, 0, 1, 0, 0), (0, 0, 10, 0, 0, 0)
    at, rho = (0, 0, R), 1e-3
    run = ours(body(BALL, SOLID, at, sliding), 1.0, friction=0.2)
    data = theirs(SPHERE, SOLID, at, sliding, friction=(0.2, 0, 0))
    yield "bowling: speed of rolling", 5 / 7, run.v[-1, 3], _of(data, 0)
    if effort.quick:
        return
    yield from inclines()
    run = ours(body(BALL, SOLID, at, rolling), 1.0, friction=0.5, rolling_friction=rho)
    data = theirs(SPHERE, SOLID, at, rolling, friction=(0.5, 0, rho))
    exact = 1 - 5 / 7 * G * rho / R
    yield "rolling friction: speed after 1 s", exact, run.v[-1, 3], _of(data, 0)
    run = ours(body(BALL, SOLID, at, spinning), 1.0, friction=0.5, spinning_friction=rho)
    data = theirs(SPHERE, SOLID, at, spinning, friction=(0.5, rho, 0))
    exact = 10 - rho * G / (0.4 * R * R)
    yield "spinning friction: spin after 1 s", exact, run.v[-1, 2], _of(data, 5)
    yield "turntable: distance of the ball from its circle after 3 s", 0.0, *turntable()
    period, width = stick_slip()
    yield "stick-slip: period", *period, None
    yield "stick-slip: amplitude", *width, None


def inclines() -> Iterator[tuple[str, float, float, float | None]]:
    """A box on a slope just below and just above its angle of friction."""
    mu = 0.5
    for part in (0.999, 1.001):
        slope = math.atan(part * mu)
        turn = (math.cos(slope / 2), 0, -math.sin(slope / 2), 0)
        normal = np.array((-math.sin(slope), 0, math.cos(slope)))
        shape = {"kind": "box", "size": (0.4, 0.4, 0.1)}
        flat = body(shape, np.eye(3) * 0.01, (*(0.05 * normal), *turn))
        run = ours(flat, 10.0, slope, friction=mu)
        data = theirs(
            'type="box" size=".2 .2 .05"', np.eye(3) * 0.01, (0, 0, 0.05), t_end=10.0,
            friction=(mu, 0, 0), slope=slope,
        )  # fmt: skip
        exact = max(G * (math.sin(slope) - mu * math.cos(slope)), 0.0) * 10
        mine, other = float(np.linalg.norm(run.v[-1, 3:])), _of(data, 0)
        other = None if other is None else abs(other)
        yield f"incline at {part} tan, speed after 10 s", exact, mine, other


def _of(data: Any, k: int) -> float | None:
    return None if data is None else float(data.qvel[k])


def ours(body: pg.Body, t_end: float, slope: float = 0.0, **contact: Any) -> pg.Result:
    """A body on the ground."""
    touch = pg.Contact(name="floor", body=body.name, **contact)
    model = pg.Model(bodies=[body], contacts=[touch], ground=pg.Ground(slope=slope))
    return pg.simulate(model, t_end=t_end, method="moreau_jean", step=STEP, frames=1001)


def body(
    shape: dict[str, Any], inertia: Array, q: Numbers, v: Numbers = NONE, com: Numbers = (0, 0, 0)
) -> pg.Body:
    """A free one of 1 kg."""
    q = (*q, 1, 0, 0, 0)[:7] if len(q) == 3 else q
    return pg.Body(name="b", joint="free", mass=1, inertia=inertia, com=com, shape=shape, q=q, v=v)


def turn_of(pose: Array) -> Array:
    """The matrix of a quaternion."""
    w, x, y, z = pose
    k = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.eye(3) + 2 * w * k + 2 * k @ k


def theirs(
    geom: str, inertia: Array, q: Numbers, v: Numbers = NONE, t_end: float = 1.0,
    friction: Numbers = (0.5, 0, 0), slope: float = 0.0, com: Numbers = (0.0, 0.0, 0.0),
    each: Callable[[Any], None] = lambda _: None,
) -> Any:  # fmt: skip
    """MuJoCo's data after t_end; `each` is called with it after every step."""
    if not has("mujoco"):
        return None
    import mujoco

    a = inertia
    words = f"{a[0, 0]} {a[1, 1]} {a[2, 2]} {a[0, 1]} {a[0, 2]} {a[1, 2]}"
    place = " ".join(str(x) for x in com)
    touch = f'friction="{friction[0]} {friction[1]} {friction[2]}" condim="6"'
    down = f"{-G * math.sin(slope)} 0 {-G * math.cos(slope)}"
    xml = f"""<mujoco>
      <option timestep="{STEP}" cone="elliptic" impratio="10" gravity="{down}"/>
      <worldbody><geom type="plane" size="9 9 1" {touch}/>
      <body><freejoint/><inertial pos="{place}" mass="1" fullinertia="{words}"/>
      <geom {geom} {touch}/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = (*q, 1, 0, 0, 0)[:7]
    data.qvel[:] = (*v[3:], *(turn_of(data.qpos[3:7]).T @ np.array(v[:3])))
    while data.time < t_end - STEP / 2:
        mujoco.mj_step(model, data)
        each(data)
    return data


def turntable() -> tuple[float, float | None]:
    """A ball that rolls on a table at 2 rad/s goes round at 2/7 of that; ours and MuJoCo's [m]."""
    radius, rate = 0.05, 2.0
    round_table = {"kind": "cylinder", "radius": 2.0, "length": 0.1}
    table = pg.Body(name="table", axes=((0, 0, 1),), link=(0, 0, -radius), mass=1.0,
                    inertia=np.eye(3), shape=round_table)  # fmt: skip
    ball = pg.Body(name="ball", joint="free", link=(0.5, 0, radius), mass=1.0,
                   inertia=np.eye(3) * 0.4 * radius**2,
                   shape={"kind": "sphere", "radius": radius})  # fmt: skip
    motion = pg.Polynomial(coefficients=(0.0, rate))
    drive = pg.Constraint(name="drive", kind="motion", body="table", q_of_t=motion)
    touch = pg.Contact(name="c", body="table", other="ball", friction=1.0)
    mech = pg.Mechanism(pg.Model(bodies=[table, ball], contacts=[touch], constraints=(drive,)))
    v = 2 / 7 * rate * 0.5
    speeds = (-(v - rate * 0.5) / radius, 0.0, 0.0, 0.0, v, 0.0)
    start = {"table": (rate,), "ball": speeds}
    run = pg.simulate(mech, v=start, t_end=3.0, method="moreau_jean", step=STEP, frames=3)
    place = 0.5 * np.array((math.cos(12 / 7), math.sin(12 / 7)))
    mine = float(np.linalg.norm(run.body_pose[-1, 1, :2] - place))
    if not has("mujoco"):
        return mine, None
    import mujoco

    xml = f"""<mujoco>
      <option timestep="{STEP}" cone="elliptic" impratio="10"/>
      <worldbody><body pos="0 0 -.05"><joint type="hinge" axis="0 0 1"/>
      <geom type="cylinder" size="2 .05" mass="1e9" friction="1 0 0"/></body>
      <body pos=".5 0 .05"><freejoint/>
      <geom type="sphere" size=".05" mass="1" friction="1 0 0"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qvel[:] = (rate, *speeds[3:], *speeds[:3])
    mujoco.mj_step(model, data, round(3.0 / STEP))
    return mine, float(np.linalg.norm(data.qpos[1:3] - place))


def stick_slip() -> tuple[tuple[float, float], tuple[float, float]]:
    """(closed form, ours) of the period [s] and of the stretch's amplitude [m]: u'' = -ω² u."""
    mass, stiffness, pull, static, kinetic = 1.0, 100.0, 0.1, 0.6, 0.4
    rate = math.sqrt(stiffness / mass)
    half = (static - kinetic) * mass * G / stiffness  # of the stretch, about that of sliding
    period = 2 * half / pull + 2 * (math.pi - math.atan(half * rate / pull)) / rate
    start = kinetic * mass * G / stiffness
    block = body({"kind": "box", "size": (0.4, 0.4, 0.1)}, np.eye(3) * 0.01, (0, 0, 0.05))
    cart = pg.Body(name="cart", joint="prismatic", axes=((1, 0, 0),), mass=1e9, inertia=np.eye(3),
                   q=(1 + start,), v=(pull,), link=(0, 0, 0.05))  # fmt: skip
    touch = pg.Contact(name="c", body="b", friction=kinetic, static_friction=static)
    spring = pg.Spring(name="s", body="b", other="cart", stiffness=stiffness, rest=1.0)
    model = pg.Model(bodies=[block, cart], contacts=[touch], forces=[spring])
    run = pg.simulate(model, t_end=6, method="moreau_jean", step=STEP, frames=6001)
    slips = run.v[:, 3] > 1e-6
    starts = run.t[1:][slips[1:] & ~slips[:-1]]
    stretch = (run.q[:, 7] - run.q[:, 0] - 1 - start)[run.t > period]
    found = float(np.diff(starts)[1:].mean()), float(np.ptp(stretch) / 2)
    return (period, found[0]), (math.hypot(half, pull / rate), found[1])


def celt() -> tuple[float, float | None]:
    """An ellipsoid whose principal axes are turned against its own reverses its spin one way."""
    a, b, c, turn = 0.2, 0.05, 0.04, 0.1
    r = turn_of(np.array((math.cos(turn / 2), 0, 0, math.sin(turn / 2))))
    inertia = r @ (np.diag((b * b + c * c, a * a + c * c, a * a + b * b)) / 5) @ r.T
    spin = (0.02, 0.02, -5.0, 0, 0, 0)
    stone = body({"kind": "ellipsoid", "radii": (a, b, c)}, inertia, (0, 0, c), spin)
    run = ours(stone, 8.0, friction=5.0)
    geom = f'type="ellipsoid" size="{a} {b} {c}"'
    data = theirs(geom, inertia, (0, 0, c), spin, 8.0, (5.0, 0, 0))
    other = None if data is None else float((turn_of(data.qpos[3:7]) @ data.qvel[3:6])[2])
    return float(run.v[-1, 2]), other


def jellett() -> tuple[float, float | None]:
    """L · r of a top that slides on a point, r from its centre of mass to where it touches."""
    off = 0.02
    start = (0, 0, R, math.cos(0.05), math.sin(0.05), 0, 0)
    spin, com = (0, 0, 80.0, 0, 0, 0), (0, 0, -off)

    def constant(pose: Array, w: Array) -> float:
        return float(0.4 * R * R * w @ (off * turn_of(pose)[:, 2] - np.array((0, 0, R))))

    run = ours(body(BALL, SOLID, start, spin, com), 4.0, friction=0.2)
    values = [constant(q[3:7], v[:3]) for q, v in zip(run.q, run.v)]
    seen: list[float] = []
    theirs(
        SPHERE, SOLID, start, spin, 4.0, (0.2, 0, 0), com=com,
        each=lambda d: seen.append(constant(d.qpos[3:7], turn_of(d.qpos[3:7]) @ d.qvel[3:6])),
    )  # fmt: skip
    mine, other = (float(np.ptp(x) / abs(x[0])) if x else None for x in (values, seen))
    assert mine is not None
    return mine, other

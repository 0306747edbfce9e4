"""Contact against closed forms, ours next to MuJoCo's: `python -m benchmarks.frictions`.

Incline at (1 ± 0.001) tan, a ball on a turntable, a sliding ball that begins to roll, decay of
rolling and of spinning, stick-slip with two coefficients, a tippe top's Jellett constant, an
ellipsoid (celt) that reverses its spin. Steps of 1 ms for both; MuJoCo with the elliptic cone,
Newton's method and impratio 10.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

Array = np.ndarray
Row = tuple[float, ...]
G, R, STEP = 9.81, 0.1, 1e-3
BALL = {"kind": "sphere", "radius": R}


def ours(body: pg.Body, t_end: float, slope: float = 0.0, **contact: Any) -> pg.Result:
    """A body on the ground."""
    touch = pg.Contact(name="floor", body=body.name, **contact)
    model = pg.Model(bodies=[body], contacts=[touch], ground=pg.Ground(slope=slope))
    return pg.simulate(model, t_end=t_end, method="moreau_jean", step=STEP, frames=1001)


def body(
    shape: dict[str, Any], inertia: Array, q: Row, v: Row = (0.0,) * 6, com: Row = (0.0, 0.0, 0.0)
) -> pg.Body:
    """One of 1 kg, free."""
    turned = (*q, 1, 0, 0, 0) if len(q) == 3 else q
    return pg.Body(
        name="b", joint="free", mass=1, inertia=inertia, com=com, shape=shape, q=turned, v=v
    )


def turn_of(pose: Array) -> Array:
    """The matrix of a quaternion."""
    w, x, y, z = pose
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def theirs(
    geom: str, inertia: Array, q: Row, v: Row = (0.0,) * 6, t_end: float = 1.0,
    friction: Row = (0.5, 0, 0), slope: float = 0.0, com: Row = (0.0, 0.0, 0.0),
    each: Callable[[Any], None] = lambda _: None,
) -> Any:  # fmt: skip
    """MuJoCo's data after t_end; `each` is called with it after every step."""
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


def cases() -> Iterator[tuple[str, float, float, float]]:
    """(name, closed form, ours, MuJoCo's; nan where it has no such law)."""
    solid = np.eye(3) * 0.4 * R * R
    geom = f'type="sphere" size="{R}"'
    for part in (0.999, 1.001):
        mu = 0.5
        slope = math.atan(part * mu)
        turn = (math.cos(slope / 2), 0, -math.sin(slope / 2), 0)
        normal = np.array((-math.sin(slope), 0, math.cos(slope)))
        box = {"kind": "box", "size": (0.4, 0.4, 0.1)}
        run = ours(body(box, np.eye(3) * 0.01, (*(0.05 * normal), *turn)), 10.0, slope, friction=mu)
        data = theirs(
            'type="box" size=".2 .2 .05"', np.eye(3) * 0.01, (0, 0, 0.05), t_end=10.0,
            friction=(mu, 0, 0), slope=slope,
        )  # fmt: skip
        exact = max(G * (math.sin(slope) - mu * math.cos(slope)), 0.0) * 10
        mine = float(np.linalg.norm(run.v[-1, 3:]))
        yield f"incline at {part} tan, speed after 10 s", exact, mine, abs(float(data.qvel[0]))
    sliding = (0, 0, 0, 1.0, 0, 0)
    run = ours(body(BALL, solid, (0, 0, R), sliding), 1.0, friction=0.2)
    data = theirs(geom, solid, (0, 0, R), sliding, friction=(0.2, 0, 0))
    yield "bowling: speed of rolling", 5 / 7, run.v[-1, 3], data.qvel[0]
    rho = 1e-3
    rolling = (0, 1 / R, 0, 1.0, 0, 0)
    run = ours(body(BALL, solid, (0, 0, R), rolling), 1.0, friction=0.5, rolling_friction=rho)
    data = theirs(geom, solid, (0, 0, R), rolling, friction=(0.5, 0, rho))
    yield "rolling friction: speed after 1 s", 1 - 5 / 7 * G * rho / R, run.v[-1, 3], data.qvel[0]
    spinning = (0, 0, 10.0, 0, 0, 0)
    run = ours(body(BALL, solid, (0, 0, R), spinning), 1.0, friction=0.5, spinning_friction=rho)
    data = theirs(geom, solid, (0, 0, R), spinning, friction=(0.5, rho, 0))
    exact = 10 - rho * G / (0.4 * R * R)
    yield "spinning friction: spin after 1 s", exact, run.v[-1, 2], data.qvel[5]
    yield "turntable: place of the ball after 3 s, off by [m]", 0.0, *turntable()
    period, width = stick_slip()
    yield "stick-slip: period", period[0], period[1], math.nan
    yield "stick-slip: amplitude", width[0], width[1], math.nan


def turntable() -> tuple[float, float]:
    """How far a ball that rolls on a table at 2 rad/s is from its circle at 2/7 of that [m]."""
    import mujoco

    from .ordinary import VARIANTS
    from .ordinary import turntable as scene

    case = scene(VARIANTS[0])
    touch = pg.Contact(name="c", body="table", other="ball", friction=case.friction)
    mech = pg.Mechanism(pg.Model(bodies=case.bodies, contacts=[touch], **(case.more or {})))
    start = case.start or {}
    run = pg.simulate(mech, v=start, t_end=3.0, method="moreau_jean", step=STEP, frames=3)
    place = 0.5 * np.array((math.cos(12 / 7), math.sin(12 / 7)))
    xml = f"""<mujoco>
      <option timestep="{STEP}" cone="elliptic" impratio="10"/>
      <worldbody><body pos="0 0 -.05"><joint type="hinge" axis="0 0 1"/>
      <geom type="cylinder" size="2 .05" mass="1e9" friction="1 0 0"/></body>
      <body pos=".5 0 .05"><freejoint/>
      <geom type="sphere" size=".05" mass="1" friction="1 0 0"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    ball = start["ball"]
    data.qvel[:] = (2.0, *ball[3:], *ball[:3])
    mujoco.mj_step(model, data, round(3.0 / STEP))
    ends = run.body_pose[-1, 1, :2], data.qpos[1:3]
    return tuple(float(np.linalg.norm(end - place)) for end in ends)  # type: ignore[return-value]


def stick_slip() -> tuple[tuple[float, float], tuple[float, float]]:
    """(closed form, ours) of the period [s] and of the stretch's amplitude [m]: u'' = -ω² u."""
    mass, stiffness, pull, static, kinetic = 1.0, 100.0, 0.1, 0.6, 0.4
    rate = math.sqrt(stiffness / mass)
    half = (static - kinetic) * mass * G / stiffness  # of the stretch, about that of sliding
    period = 2 * half / pull + 2 * (math.pi - math.atan(half * rate / pull)) / rate
    start = kinetic * mass * G / stiffness
    block = body({"kind": "box", "size": (0.4, 0.4, 0.1)}, np.eye(3) * 0.01, (0, 0, 0.05))
    cart = pg.Body(
        name="cart", joint="prismatic", axes=((1, 0, 0),), mass=1e9, inertia=np.eye(3),
        q=(1 + start,), v=(pull,), rotation=(1, 0, 0, 0), link=(0, 0, 0.05),
    )  # fmt: skip
    touch = pg.Contact(name="c", body="b", friction=kinetic, static_friction=static)
    spring = pg.Spring(name="s", body="b", other="cart", stiffness=stiffness, rest=1.0)
    model = pg.Model(bodies=[block, cart], contacts=[touch], forces=[spring])
    run = pg.simulate(model, t_end=6, method="moreau_jean", step=STEP, frames=6001)
    slips = run.v[:, 3] > 1e-6
    starts = run.t[1:][slips[1:] & ~slips[:-1]]
    stretch = (run.q[:, 7] - run.q[:, 0] - 1 - start)[run.t > period]
    found = float(np.diff(starts)[1:].mean()), float(np.ptp(stretch) / 2)
    return (period, found[0]), (math.hypot(half, pull / rate), found[1])


def main() -> None:
    """Print the table."""
    print("| case | closed form | error of ours | of MuJoCo's |\n|---|---|---|---|")
    for name, exact, mine, other in cases():
        print(f"| {name} | {exact:.6g} | {mine - exact:.1e} | {other - exact:.1e} |")
    mine, other = celt()
    print(f"\ncelt: spin about the vertical each second {mine}; MuJoCo's {other}")
    mine, other = jellett()
    print(f"tippe top: Jellett's constant changes by {mine:.1e} of itself, MuJoCo's by {other:.1e}")


def celt() -> tuple[str, str]:
    """An ellipsoid whose principal axes are turned against its own reverses its spin one way."""
    a, b, c = 0.2, 0.05, 0.04
    turn = 0.1
    x, y = math.cos(turn), math.sin(turn)
    r = np.array(((x, -y, 0), (y, x, 0), (0, 0, 1)))
    own = np.diag((b * b + c * c, a * a + c * c, a * a + b * b)) / 5
    spin = (0.02, 0.02, -5.0, 0, 0, 0)
    inertia = r @ own @ r.T
    stone = body({"kind": "ellipsoid", "radii": (a, b, c)}, inertia, (0, 0, c), spin)
    run = ours(stone, 8.0, friction=5.0)
    seen: list[float] = [spin[2]]
    theirs(
        f'type="ellipsoid" size="{a} {b} {c}"', inertia, (0, 0, c), spin, 8.0, (5.0, 0, 0),
        each=lambda d: seen.append(float((turn_of(d.qpos[3:7]) @ d.qvel[3:6])[2])),
    )  # fmt: skip
    said = [", ".join(f"{x:.2f}" for x in spins) for spins in (run.v[::125, 2], seen[::1000])]
    return said[0], said[1]


def jellett() -> tuple[float, float]:
    """L · r of a top that slides on a point, r from its centre of mass to where it touches."""
    off = 0.02
    start = (0, 0, R, math.cos(0.05), math.sin(0.05), 0, 0)
    spin, com, inertia = (0, 0, 80.0, 0, 0, 0), (0, 0, -off), np.eye(3) * 0.4 * R * R

    def constant(pose: Array, w: Array) -> float:
        return float(0.4 * R * R * w @ (off * turn_of(pose)[:, 2] - np.array((0, 0, R))))

    run = ours(body(BALL, inertia, start, spin, com), 4.0, friction=0.2)
    values = [constant(q[3:7], v[:3]) for q, v in zip(run.q, run.v)]
    seen: list[float] = []
    theirs(
        f'type="sphere" size="{R}"', inertia, start, spin, 4.0, (0.2, 0, 0), com=com,
        each=lambda d: seen.append(constant(d.qpos[3:7], turn_of(d.qpos[3:7]) @ d.qvel[3:6])),
    )  # fmt: skip
    return tuple(float(np.ptp(x) / abs(x[0])) for x in (values, seen))  # type: ignore[return-value]


if __name__ == "__main__":
    main()

"""Contact against closed forms, ours next to MuJoCo's: `python -m benchmarks.frictions`.

Incline at (1 ± 0.001) tan, a sliding ball that begins to roll, decay of rolling and of spinning, a
tippe top's Jellett constant, an ellipsoid (celt) that reverses its spin. Steps of 1 ms for both;
MuJoCo with the elliptic cone, Newton's method and impratio 10.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
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


def theirs(
    geom: str, inertia: Array, q: Row, v: Row = (0.0,) * 6, t_end: float = 1.0,
    friction: Row = (0.5, 0, 0), slope: float = 0.0,
) -> Any:  # fmt: skip
    """MuJoCo's data after t_end."""
    import mujoco

    words = " ".join(str(x) for x in np.diag(inertia))
    touch = f'friction="{friction[0]} {friction[1]} {friction[2]}" condim="6"'
    down = f"{-G * math.sin(slope)} 0 {-G * math.cos(slope)}"
    xml = f"""<mujoco>
      <option timestep="{STEP}" cone="elliptic" impratio="10" gravity="{down}"/>
      <worldbody><geom type="plane" size="9 9 1" {touch}/>
      <body><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="{words}"/>
      <geom {geom} {touch}/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = (*q, 1, 0, 0, 0)
    data.qvel[:] = (*v[3:], *v[:3])
    while data.time < t_end - STEP / 2:
        mujoco.mj_step(model, data)
    return data


def cases() -> Iterator[tuple[str, float, float, float]]:
    """(name, closed form, ours, MuJoCo's)."""
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


def main() -> None:
    """Print the table."""
    print("| case | closed form | error of ours | of MuJoCo's |\n|---|---|---|---|")
    for name, exact, mine, other in cases():
        print(f"| {name} | {exact:.6g} | {mine - exact:.1e} | {other - exact:.1e} |")
    print(f"\ncelt: spin about the vertical over time {celt()}")
    print(f"tippe top: Jellett's constant changes by {jellett():.1e} of itself")


def celt() -> str:
    """An ellipsoid whose principal axes are turned against its own reverses its spin one way."""
    a, b, c = 0.2, 0.05, 0.04
    turn = 0.1
    x, y = math.cos(turn), math.sin(turn)
    r = np.array(((x, -y, 0), (y, x, 0), (0, 0, 1)))
    own = np.diag((b * b + c * c, a * a + c * c, a * a + b * b)) / 5
    stone = body(
        {"kind": "ellipsoid", "radii": (a, b, c)}, r @ own @ r.T, (0, 0, c),
        (0.02, 0.02, -5.0, 0, 0, 0),
    )  # fmt: skip
    run = ours(stone, 8.0, friction=5.0)
    return ", ".join(f"{x:.2f}" for x in run.v[::125, 2])


def jellett() -> float:
    """L · r of a top that slides on a point, r from its centre of mass to where it touches."""
    off = 0.02
    start = (0, 0, R, math.cos(0.05), math.sin(0.05), 0, 0)
    top = body(BALL, np.eye(3) * 0.4 * R * R, start, (0, 0, 80.0, 0, 0, 0), (0, 0, -off))
    run = ours(top, 4.0, friction=0.2)
    values = []
    for pose, v in zip(run.q, run.v):
        w, x, y, z = pose[3:7]
        axis = np.array((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)))
        values.append(0.4 * R * R * v[:3] @ (off * axis - np.array((0, 0, R))))
    return float(np.ptp(values) / abs(values[0]))


if __name__ == "__main__":
    main()

"""Contacts that hold, against MuJoCo: stacks, separate stacks, heavy on light, grippers, piles.

`python -m benchmarks.stacks [stacks islands heavy gripper piles exponent]` prints a line a scene:
processor time a step here and there, in one process and in turns, and what is right or missed.
MuJoCo runs with its elliptic cone and Newton's method, and its default softness.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg

STEP = 1e-3
SIDE = 0.2
ROUNDS = 3
G = 9.81
Start = dict[str, tuple[float, ...]] | None  # velocities of bodies: angular, linear


def box(name: str, place: Any, mass: float = 1.0, side: float = SIDE) -> pg.Body:
    """A cube."""
    return pg.Body(
        name=name, joint="free", link=tuple(place), mass=mass,
        inertia=np.eye(3) * mass * side**2 / 6, shape={"kind": "box", "size": (side,) * 3},
    )  # fmt: skip


def ball(name: str, place: Any, radius: float = 0.5) -> pg.Body:
    """A solid ball of 1 kg."""
    return pg.Body(
        name=name, joint="free", link=tuple(place), mass=1.0,
        inertia=np.eye(3) * 0.4 * radius**2, shape={"kind": "sphere", "radius": radius},
    )  # fmt: skip


def heap(bodies: list[pg.Body], friction: float = 0.5) -> pg.Model:
    """Bodies that may all touch each other and the ground."""
    contacts = (
        pg.Contact(name="floor", body="*", friction=friction),
        pg.Contact(name="heap", body="*", other="*", friction=friction),
    )
    return pg.Model(bodies=tuple(bodies), contacts=contacts)


def stack(count: int, x: float = 0.0, name: str = "b", top: float = 1.0) -> list[pg.Body]:
    """Boxes on one another; the last one's mass is `top` [kg]."""
    masses = [1.0] * (count - 1) + [top]
    return [box(f"{name}{i}", (x, 0, SIDE * (i + 0.5)), m) for i, m in enumerate(masses)]


def grid(count: int, radius: float = 0.5, apart: float = 1.01) -> list[pg.Body]:
    """Balls on a cubic grid, `apart` in diameters, shaken by 2 % of that.

    Closer than 1.04 some of them overlap at the start.
    """
    side = round(count ** (1 / 3) + 0.5)
    places = np.indices((side,) * 3).reshape(3, -1).T[:count] + 0.0
    places += np.random.default_rng(0).uniform(-0.02, 0.02, (count, 3))
    up = np.array([0, 0, 1.05 * radius])
    return [ball(f"s{i}", p) for i, p in enumerate(2 * apart * radius * places + up)]


def ours(model: pg.Model, seconds: float, start: Start = None) -> tuple[float, Any]:
    """(processor seconds a step, the run)."""
    mech = pg.Mechanism(model)
    q, v = mech.home()
    for name, speeds in (start or {}).items():
        v[mech.joints[name].v] = speeds
    run = pg.simulate(
        mech, q, v, t_end=seconds, step=STEP, frames=3, method="moreau_jean", estimate=False
    )
    return run.timing["step_processor"] / round(seconds / STEP), run


def mujoco_of(model: pg.Model, start: Start = None) -> tuple[Any, Any]:
    """The same free boxes, balls and hulls in MuJoCo."""
    mujoco: Any = import_module("mujoco")

    spec = mujoco.MjSpec()
    spec.memory = 1 << 30
    spec.option.timestep = STEP
    spec.option.gravity = [0, 0, -G]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    rub = [model.contacts[0].friction, 0, 0]
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[100, 100, 1], friction=rub)
    for one in model.bodies:
        body = spec.worldbody.add_body(name=one.name, pos=list(one.link), quat=list(one.rotation))
        body.add_freejoint()
        body.mass, body.explicitinertial = one.mass, True
        body.inertia = np.diag(np.array(one.inertia)).tolist()
        shape: Any = one.touching[0]
        if shape.kind == "box":
            half = [x / 2 for x in shape.size]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, friction=rub, condim=3)
        elif shape.kind == "mesh":
            lines = Path(shape.file).read_text(encoding="utf-8").splitlines()
            corners = [
                float(x) for line in lines if line.startswith("v ") for x in line.split()[1:]
            ]
            spec.add_mesh(name=one.name, uservert=corners)
            kind = mujoco.mjtGeom.mjGEOM_MESH
            body.add_geom(type=kind, meshname=one.name, friction=rub, condim=3)
        else:
            size = [shape.radius, 0, 0]
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, friction=rub, condim=3)
    built = spec.compile()
    data = mujoco.MjData(built)
    for name, speeds in (start or {}).items():  # linear first, angular in the body's axes there
        k = 6 * [one.name for one in model.bodies].index(name)
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.array(model.bodies[k // 6].rotation, dtype=float))
        data.qvel[k : k + 3] = speeds[3:]
        data.qvel[k + 3 : k + 6] = turn.reshape(3, 3).T @ np.array(speeds[:3])
    return built, data


def theirs(model: pg.Model, seconds: float, start: Start = None) -> tuple[float, Any]:
    """(processor seconds a step, MuJoCo's data at the end)."""
    mujoco: Any = import_module("mujoco")

    built, data = mujoco_of(model, start)
    steps = round(seconds / STEP)
    begin = time.process_time()
    mujoco.mj_step(built, data, steps)
    return (time.process_time() - begin) / steps, data


def compared(
    name: str, model: pg.Model, seconds: float, rounds: int = ROUNDS, start: Start = None
) -> Any:
    """Print both sides' cost a step, the fastest of some rounds; our last run."""
    here, there = np.inf, np.inf
    run: Any = None
    data: Any = None
    for _ in range(rounds):
        mine, run = ours(model, seconds, start)
        other, data = theirs(model, seconds, start)
        here, there = min(here, mine), min(there, other)
    speeds = abs(run.v[-1]).max(), abs(data.qvel).max()
    print(
        f"{name}: {here * 1e6:.1f} us a step, MuJoCo {there * 1e6:.1f} us, ratio "
        f"{here / there:.2f}; fastest {speeds[0]:.1e} and {speeds[1]:.1e} at the end, "
        f"{data.ncon} contacts there; "
        f"residual {run.contact_residual.max(axis=0)}; {'; '.join(run.notices) or 'no notice'}",
        flush=True,
    )
    return run


def stacks() -> None:
    """Stacks of equal boxes at rest after 2 s."""
    for count in (2, 3, 5, 8, 12, 20, 30):
        run = compared(f"stack of {count}", heap(stack(count)), 2.0)
        print(f"    sunk {abs(run.q[-1].reshape(count, 7)[:, 2]).max():.1e} m")


def islands() -> None:
    """Separate stacks: the cost of k of them over k times the cost of one."""
    single = min(ours(heap(stack(5)), 1.0)[0] for _ in range(ROUNDS))
    for count in (2, 3, 6, 12):
        bodies = [b for k in range(count) for b in stack(5, 1.0 * k, f"s{k} ")]
        cost = min(ours(heap(bodies), 1.0)[0] for _ in range(ROUNDS))
        print(f"{count} stacks of 5: {cost / single / count:.2f} of {count} times one", flush=True)


def heavy() -> None:
    """1e6 kg on boxes of 1 kg."""
    for count in (2, 5, 10):
        compared(f"1e6 kg on {count - 1} of 1 kg", heap(stack(count, top=1e6)), 0.5, 1)


def gripper() -> None:
    """An object of 0.5 kg between fingers on slides, pressed with 0.99 and 1.01 of what it needs.

    A box has no faces for three.
    """
    for kind, size in (("box", "size"), ("cylinder", "radius"), ("sphere", "radius")):
        for fingers in (2, 3):
            if fingers == 3 and kind == "box":
                continue
            for friction in (0.2, 0.5, 1.0):
                slips = held(kind, size, fingers, friction, 0.99, 2.0)
                holds = held(kind, size, fingers, friction, 1.01, 60.0)
                print(
                    f"{fingers} fingers, {kind}, friction {friction}: falls {slips[0]:.2g} m in "
                    f"2 s at 0.99, {holds[0]:.1e} m in 60 s at 1.01 of the force needed; "
                    f"loads differ by {holds[1]:.1e}",
                    flush=True,
                )


def held(
    kind: str, size: str, fingers: int, friction: float, part: float, seconds: float
) -> tuple[float, float]:
    """(how far the object falls [m], relative difference of the fingers' loads at the end)."""
    length, mass = 0.05, 0.5
    push = part * mass * G / fingers / friction
    shape: Any = {"kind": kind, size: (length,) * 3 if size == "size" else length / 2}
    if kind == "cylinder":
        shape["length"] = length
    bodies = [
        pg.Body(
            name="object", joint="free", mass=mass, inertia=np.eye(3) * mass * length**2 / 6,
            shape=shape,
        )
    ]  # fmt: skip
    contacts, forces = [], []
    for k in range(fingers):
        angle = 2 * np.pi * k / fingers
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        turn = (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))
        pad: Any = {"kind": "box", "size": (0.01, 0.04, 0.04), "rotation": turn}
        place = tuple((length / 2 + 0.005) * out)
        bodies.append(
            pg.Body(
                name=f"f{k}", joint="compound", motions=(("translate", tuple(out)),), link=place,
                mass=0.1, inertia=np.eye(3) * 1e-4, shape=pad,
            )
        )  # fmt: skip
        contacts.append(pg.Contact(name=f"p{k}", body="object", other=f"f{k}", friction=friction))
        forces.append(pg.Force(name=f"w{k}", kind="wrench", body=f"f{k}", force=tuple(-push * out)))
    model = pg.Model(bodies=tuple(bodies), contacts=tuple(contacts), forces=tuple(forces))
    run = pg.simulate(model, t_end=seconds, step=STEP, frames=3, estimate=False)
    loads = np.array([run.contact_force[c.name][-1, 5] for c in contacts])
    return -run.body_pose[-1, 0, 2], float(np.ptp(loads) / max(abs(loads).max(), 1e-300))


def piles() -> None:
    """Balls that fall from a grid, with gaps at the start, and overlapping."""
    for apart, what in ((1.06, "apart"), (1.01, "overlapping")):
        for count, seconds in ((27, 1.5), (125, 1.0), (343, 0.6), (1000, 0.4)):
            name = f"{count} balls, {what} at the start"
            model = heap(grid(count, apart=apart))
            compared(name, model, seconds, 2 if count < 343 else 1)
            here, there = met(model, seconds)
            print(f"    contacts on average: {here:.0f} here, {there:.0f} there", flush=True)


def met(model: pg.Model, seconds: float, looks: int = 20) -> tuple[float, float]:
    """How many contacts there are at `looks` instants of the run on average, here and there."""
    mujoco: Any = import_module("mujoco")

    run = pg.simulate(
        model, t_end=seconds, step=STEP, frames=looks + 1, method="moreau_jean", estimate=False
    )
    here = [touching(run, k) for k in range(1, looks + 1)]
    built, data = mujoco_of(model)
    there = []
    for _ in range(looks):
        mujoco.mj_step(built, data, round(seconds / STEP / looks))
        there.append(data.ncon)
    return float(np.mean(here)), float(np.mean(there))


def touching(run: Any, frame: int = -1, near: float = 1e-3) -> int:
    """How many balls are nearer to each other, or to the ground, than a part of their diameter."""
    place = run.body_pose[frame, :, :3]
    size = 2 * run.mechanism.model.bodies[0].touching[0].radius
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    pairs = apart[np.triu_indices(len(place), 1)] < (1 + near) * size
    return int(pairs.sum() + (place[:, 2] < (0.5 + near) * size).sum())


def exponent() -> None:
    """How the cost of a step of fallen piles grows with their contacts."""
    found = []
    for count in (125, 216, 343, 512, 729, 1000, 1728, 2744, 4096):
        mech = pg.Mechanism(heap(grid(count, apart=1.06)))
        options: Any = {"step": STEP, "frames": 2, "method": "moreau_jean", "estimate": False}
        run = pg.simulate(mech, t_end=0.3, **options)
        run = pg.simulate(mech, run.q[-1], run.v[-1], t_end=0.05, **options)
        found.append((touching(run), run.timing["step_processor"] / 50))
        print(f"{count} balls: {found[-1][0]} contacts, {found[-1][1] * 1e6:.0f} us a step")
    contacts, costs = np.log(np.array(found)).T
    power = np.polyfit(contacts, costs, 1)[0]
    print(f"cost grows as contacts^{power:.2f}", flush=True)


PARTS = {f.__name__: f for f in (stacks, islands, heavy, gripper, piles, exponent)}

if __name__ == "__main__":
    compared("warm up", heap(stack(2)), 0.01, 1)
    for part in sys.argv[1:] or PARTS:
        PARTS[part]()

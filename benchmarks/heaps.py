"""Stacks, heavy on light, piles, dominoes and falling boxes against MuJoCo.

MuJoCo runs with its elliptic cone and Newton's method, and its default softness. Soft contacts
rebound, so its heaps spread. Each row therefore states the contacts of both at the end.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import has
from .measure import Effort, Row, compared
from .scenes import STEP

MINUTES = 10.0
PEERS = ("mujoco",)
SIDE = 0.2  # m, of boxes
NEAR = 1e-5  # m: a gap that counts as a contact
Start = dict[str, tuple[float, ...]]  # velocities of bodies: angular, linear


def rows(effort: Effort) -> Iterator[Row]:
    for count in effort.pick((2, 3, 5, 8, 12, 20, 30), (2,)):
        model = heap(stack(count))
        yield from both(effort, f"stack of {count}", model, effort.pick(2.0, 0.01))
    if effort.quick:
        return
    for count in (2, 5, 10):
        model = heap(stack(count, top=1e6))
        yield from both(effort, f"1e6 kg on {count - 1} of 1 kg", model, 0.5)
    for count in (1, 2, 3, 6, 12):
        bodies = [b for k in range(count) for b in stack(5, 1.0 * k, f"s{k} ")]
        yield from both(effort, f"{count} stacks of 5", heap(bodies), 1.0)
    for apart, what in ((1.06, "apart"), (1.01, "overlapping")):
        for count, seconds in ((27, 1.5), (125, 1.0), (343, 0.6), (1000, 0.4)):
            name = f"{count} balls, {what} at the start"
            yield from both(effort, name, heap(grid(count, apart)), seconds)
    yield from both(effort, "12 dominoes", heap(dominoes(), 0.4), 1.2, {"d0": (0, 6, 0, 0.6, 0, 0)})
    kick = {"b3": (0, 0, 0, 1, 0, 0)}
    yield from both(effort, "8 boxes, one kicked", heap(stack(8), 0.4), 0.8, kick)
    yield from both(effort, "27 boxes that fall on a heap", heap(thrown()), 1.0)


def both(
    effort: Effort, name: str, model: pg.Model, seconds: float, start: Start | None = None
) -> Iterator[Row]:
    """Processor time per step of both, and contacts and the fastest body of each at the end."""
    mech, steps = pg.Mechanism(model), round(seconds / STEP)
    q, v = mech.home()
    for body, speeds in (start or {}).items():
        v[mech.joints[body].v] = speeds
    given: dict[str, Any] = {"t_end": seconds, "step": STEP, "method": "moreau_jean"}
    last: dict[str, float] = {}
    ends: dict[str, Any] = {}
    notices: list[str] = []

    def ours() -> float:
        run = pg.simulate(mech, q, v, frames=3, estimate=False, **given)
        last["ours"], notices[:] = abs(run.v[-1]).max(), run.notices
        ends["ours"] = run.body_pose[-1].ravel()
        return run.timing["step_processor"]

    def theirs() -> float:
        import mujoco

        built, data = mujoco_of(model, start or {})
        begin = time.thread_time()
        mujoco.mj_step(built, data, steps)
        spent = time.thread_time() - begin
        last["MuJoCo"], ends["MuJoCo"] = abs(data.qvel).max(), data.qpos.copy()
        return spent

    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    if has("mujoco"):
        sides["mj_step"] = theirs
    options: dict[str, Any] = {"clocked": set(sides), "rounds": effort.pick(3, 1)}
    found = list(compared(effort, name, sides, unit="step", per_call=steps, **options))
    said = ", ".join(f"{side} {speed:.0e}" for side, speed in last.items())
    if has("mujoco"):
        built = mujoco_of(model, {})
        touch = ", ".join(f"{side} {contacts(*built, q)}" for side, q in ends.items())
        said += f"; contacts at the end: {touch}"
    found[0]["agrees"] = "; ".join((f"fastest at the end: {said}", *notices))
    return iter(found)


def contacts(built: Any, data: Any, q: Any) -> int:
    """Count the contact points at a position of all free bodies, as MuJoCo finds them."""
    import mujoco

    built.geom_margin[:], data.qpos[:] = NEAR, q
    mujoco.mj_fwdPosition(built, data)
    return data.ncon


def box(name: str, place: Any, mass: float = 1.0, size: Any = (SIDE,) * 3, turn: Any = None) -> Any:
    """A free box."""
    x, y, z = size
    return pg.Body(
        name=name, joint="free", link=tuple(place), mass=mass, rotation=turn or (1, 0, 0, 0),
        inertia=mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y]),
        shape={"kind": "box", "size": tuple(size)},
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


def grid(count: int, apart: float, radius: float = 0.5) -> list[pg.Body]:
    """Balls on a cubic grid, `apart` diameters, shaken by 2 % of that: below 1.04 some overlap."""
    side = round(count ** (1 / 3) + 0.5)
    places = np.indices((side,) * 3).reshape(3, -1).T[:count] + 0.0
    places += np.random.default_rng(0).uniform(-0.02, 0.02, (count, 3))
    ball: Any = {"kind": "sphere", "radius": radius}
    given: Any = {"joint": "free", "mass": 1.0, "inertia": np.eye(3) * 0.4 * radius**2}
    places = 2 * apart * radius * places + np.array([0, 0, 1.05 * radius])
    return [pg.Body(name=f"s{i}", link=tuple(p), shape=ball, **given) for i, p in enumerate(places)]


def dominoes() -> list[pg.Body]:
    """Twelve in a row."""
    size = (0.02, 0.1, 0.2)
    return [box(f"d{k}", (0.08 * k, 0, 0.1), 0.1, size) for k in range(12)]


def thrown() -> list[pg.Body]:
    """27 boxes in the air, turned at random."""
    dice = np.random.default_rng(0)
    places = np.indices((3, 3, 3)).reshape(3, -1).T * [0.16, 0.16, 0.2] + [0, 0, 0.12]
    turns = dice.normal(size=(27, 4))
    turns /= np.linalg.norm(turns, axis=1)[:, None]
    both = enumerate(zip(places, turns))
    return [box(f"b{k}", place, 1.0, (0.1,) * 3, tuple(turn)) for k, (place, turn) in both]


def mujoco_of(model: pg.Model, start: Start) -> tuple[Any, Any]:
    """The same free boxes and balls in MuJoCo."""
    import mujoco

    spec, geom = mujoco.MjSpec(), mujoco.mjtGeom
    spec.memory = 1 << 30
    spec.option.timestep = STEP
    spec.option.gravity = [0, 0, -9.81]
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    rub = [model.contacts[0].friction, 0, 0]
    spec.worldbody.add_geom(type=geom.mjGEOM_PLANE, size=[100, 100, 1], friction=rub)
    for one in model.bodies:
        body = spec.worldbody.add_body(name=one.name, pos=list(one.link), quat=list(one.rotation))
        body.add_freejoint()
        body.mass, body.explicitinertial = one.mass, True
        body.inertia = np.diag(np.array(one.inertia)).tolist()
        shape: Any = one.touching[0]
        if shape.kind == "box":
            kind, size = geom.mjGEOM_BOX, [x / 2 for x in shape.size]
        else:
            kind, size = geom.mjGEOM_SPHERE, [shape.radius, 0, 0]
        body.add_geom(type=kind, size=size, friction=rub, condim=3)
    built = spec.compile()
    data = mujoco.MjData(built)
    names = [one.name for one in model.bodies]
    for name, speeds in start.items():  # linear first; bodies that start are not turned
        k = 6 * names.index(name)
        data.qvel[k : k + 6] = (*speeds[3:], *speeds[:3])
    return built, data

"""Ordinary scenes of contact, near and far, small and large, at narrow and wide steps.

`python -m benchmarks.ordinary [names]` prints a line a scene and variant: how far it is from what
is known of it, whether that is right, and processor time. What is not right is told, by a notice or
the status, or wrong. Times and steps of a variant go with its scale: 1 s becomes √scale seconds.
`python -m benchmarks.ordinary speed` compares processor time a step with MuJoCo's, of scenes in
which much slides and hits; `peer` what cards and a prism of 64 sides do there.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import pgraph_core as pg

from .stacks import compared, heap, ours, theirs

G = 9.81
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Variant:
    """Where a scene stands, how large it is, and how wide its steps are at size 1."""

    name: str
    far: float = 0.0
    scale: float = 1.0
    step: float = 1e-3


VARIANTS = (
    Variant("as it is"), Variant("1 km away", far=1000.0), Variant("1/200 of it", scale=0.005),
    Variant("500 of it", scale=500.0), Variant("steps of 0.1 ms", step=1e-4),
    Variant("steps of 10 ms", step=1e-2),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A model, its start, how long it runs, and what it is off by at the end."""

    bodies: list[pg.Body]
    seconds: float
    off: Callable[[Any, Variant], float]
    close: float  # what counts as right
    friction: float = 0.5
    more: dict[str, Any] | None = None  # other fields of the model
    start: dict[str, tuple[float, ...]] | None = None  # velocities of bodies


def block(
    name: str, place: Any, size: Any, s: Variant, mass: float = 1.0, tilt: float = 0.0
) -> Any:
    """A free box, turned about y by `tilt`; lengths at scale 1."""
    x, y, z = s.scale * np.array(size, dtype=float)
    inertia = mass / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
    turn = (np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0)
    shape: Any = {"kind": "box", "size": (x, y, z)}
    return pg.Body(
        name=name, joint="free", link=tuple(s.scale * np.array(place) + [s.far, 0, 0]), mass=mass,
        rotation=turn, inertia=inertia, shape=shape,
    )  # fmt: skip


def moved(run: Any, s: Variant) -> float:
    """How far any body is from where it started [size]."""
    place = run.body_pose[:, :, :3]
    return float(abs(place[-1] - place[0]).max() / s.scale)


def stack(s: Variant) -> Case:
    """Ten boxes on one another."""
    return Case(
        [block(f"b{k}", (0, 0, 0.2 * (k + 0.5)), (0.2,) * 3, s) for k in range(10)],
        1.0,
        moved,
        1e-6,
    )


def heavy(s: Variant) -> Case:
    """1e6 kg on four boxes of 1 kg."""
    masses = (1, 1, 1, 1, 1e6)
    bodies = [
        block(f"b{k}", (0, 0, 0.2 * (k + 0.5)), (0.2,) * 3, s, m) for k, m in enumerate(masses)
    ]
    return Case(bodies, 0.5, moved, 1e-6)


def pushed(s: Variant) -> Case:
    """Five boxes in a row, pushed at one end: a = F / m - μ g."""
    bodies = [block(f"b{k}", (0.2 * k, 0, 0.1), (0.2,) * 3, s) for k in range(5)]
    push = pg.Force(name="push", kind="wrench", body="b0", force=(5 * 0.8 * G, 0, 0))
    want = 0.5 * (0.8 - 0.5) * G * 0.25

    def off(run: Any, s: Variant) -> float:
        x = (run.body_pose[-1, :, 0] - run.body_pose[0, :, 0]) / s.scale
        return float(abs(x - want).max() / want)

    return Case(bodies, 0.5, off, 0.01, more={"forces": (push,)})


def belt(s: Variant) -> Case:
    """A block on a belt of 1e6 kg that drives at 1 m/s: it slides, then goes along."""
    size = (40.0, 1.0, 0.2)
    belt = pg.Body(
        name="belt", joint="prismatic", axes=((1, 0, 0),), mass=1e6,
        link=(s.far, 0, -0.1 * s.scale),
        shape={"kind": "box", "size": tuple(s.scale * x for x in size)},  # type: ignore[arg-type]
    )  # fmt: skip
    speed = np.sqrt(s.scale)
    motion = pg.Polynomial(coefficients=(0.0, speed))
    drive = pg.Constraint(name="drive", kind="motion", body="belt", q_of_t=motion)
    want = 1.0 - 0.5 / (0.5 * G)  # m after 1 s: it slips for v / (μ g)

    def off(run: Any, s: Variant) -> float:
        return float(abs((run.body_pose[-1, 1, 0] - s.far) / s.scale - want))

    b = block("b", (0, 0, 0.1), (0.2,) * 3, s)
    more = {"constraints": (drive,)}
    return Case([belt, b], 1.0, off, 0.01, more=more, start={"belt": (speed,)})


def turntable(s: Variant) -> Case:
    """A ball that rolls on a table turning at 2 rad/s goes round at 2/7 of it."""
    radius, rate = 0.05 * s.scale, 2.0 / np.sqrt(s.scale)
    table = pg.Body(
        name="table", axes=((0, 0, 1),), link=(s.far, 0, -0.05 * s.scale), mass=1.0,
        inertia=np.eye(3) * s.scale**2,
        shape={"kind": "cylinder", "radius": 2.0 * s.scale, "length": 0.1 * s.scale},
    )  # fmt: skip
    motion = pg.Polynomial(coefficients=(0.0, rate))
    drive = pg.Constraint(name="drive", kind="motion", body="table", q_of_t=motion)
    ball = pg.Body(
        name="ball", joint="free", link=(s.far + 0.5 * s.scale, 0, radius), mass=1.0,
        inertia=np.eye(3) * 0.4 * radius**2, shape={"kind": "sphere", "radius": radius},
    )  # fmt: skip
    # Rolling: the contact point goes with the table, and the centre at 2/7 of it about the axis.
    v = 2 / 7 * rate * 0.5 * s.scale
    spin = (v - rate * 0.5 * s.scale) / radius
    angle = 2 / 7 * 2.0 * 3.0

    def off(run: Any, s: Variant) -> float:
        place = (run.body_pose[-1, 1, :2] - [s.far, 0]) / s.scale
        return float(np.hypot(*(place - 0.5 * np.array([np.cos(angle), np.sin(angle)]))))

    start = {"table": (rate,), "ball": (-spin, 0.0, 0.0, 0.0, v, 0.0)}
    return Case([table, ball], 3.0, off, 0.01, 1.0, {"constraints": (drive,)}, start)


def dominoes(s: Variant) -> Case:
    """Ten in a row; the first is pushed, and all fall."""
    bodies = [block(f"d{k}", (0.06 * k, 0, 0.1), (0.02, 0.1, 0.2), s, 0.1) for k in range(10)]
    speed = 3.0 / np.sqrt(s.scale)

    def off(run: Any, s: Variant) -> float:
        x, y = run.body_pose[-1, :, 4:6].T
        return float(np.sum(1 - 2 * (x * x + y * y) > 0.9))  # that stand

    return Case(bodies, 2.0, off, 0.5, start={"d0": (0, speed, 0, 0.1 * speed * s.scale, 0, 0)})


def cards(s: Variant) -> Case:
    """Two cards that lean on each other; they stand where μ > tan(lean) / 2 at their feet."""
    length, thick, lean = 0.1, 0.002, 0.3
    half = 0.5 * np.array([length * np.sin(lean) + thick * np.cos(lean), 0.0])[0]
    high = 0.5 * (length * np.cos(lean) + thick * np.sin(lean))
    bodies = [
        block(name, (side * half, 0, high), (thick, 0.06, length), s, 0.002, -side * lean)
        for name, side in (("left", -1), ("right", 1))
    ]
    return Case(bodies, 2.0, moved, 1e-3)


def house(s: Variant) -> Case:
    """Two storeys of cards: a card lies on two pairs that lean on each other, a third on it."""
    length, thick, lean, apart = 0.1, 0.002, 0.3, 0.07
    half = 0.5 * (length * np.sin(lean) + thick * np.cos(lean))
    high = 0.5 * (length * np.cos(lean) + thick * np.sin(lean))
    size, bodies = (thick, 0.06, length), []
    for name, x, z in (("a", -apart / 2, 0.0), ("b", apart / 2, 0.0), ("c", 0.0, 2 * high + thick)):
        for side in (-1, 1):
            place = (x + side * half, 0, z + high)
            bodies.append(block(f"{name}{side}", place, size, s, 0.002, -side * lean))
    bodies.append(block("flat", (0, 0, 2 * high + thick / 2), (0.12, 0.06, thick), s, 0.002))
    return Case(bodies, 2.0, moved, 1e-3)


def hull(name: str, place: Any, corners: Any, faces: Any, s: Variant, **fields: Any) -> pg.Body:
    """A free body whose shape is the convex hull of corners, given about its centre at scale 1."""
    path = Path(tempfile.mkdtemp()) / f"{name}.obj"
    lines = ["v " + " ".join(map(repr, (s.scale * np.array(c)).tolist())) for c in corners]
    lines += [f"f {f[0]} {f[i]} {f[i + 1]}" for f in faces for i in range(1, len(f) - 1)]
    path.write_text("\n".join(lines))
    return pg.Body(
        name=name, joint="free", link=tuple(s.scale * np.array(place) + [s.far, 0, 0]),
        shape={"kind": "mesh", "file": str(path), "hull": "convex"}, **fields,
    )  # fmt: skip


@cache
def rolled(sides: int, radius: float, inertia: float, rate: float, seconds: float) -> float:
    """How far a prism of 1 kg rolls from side to side [m], on an edge at the start.

    About an edge it is a pendulum upside down; where the next edge lands, its moment of momentum
    about that stays.
    """
    turn, about_edge = 2 * np.pi / sides, inertia + radius**2
    pull = radius * G / about_edge

    def fall(_t: float, y: Any) -> Any:
        return y[1], pull * np.sin(y[0])

    def lands(_t: float, y: Any) -> float:
        return float(y[0] - turn / 2)

    lands.terminal = True  # type: ignore[attr-defined]
    left, way, spin = seconds, 0.0, rate
    while left > 0.0:
        start = (-turn / 2, spin)  # the angle of the edge's arm from the vertical, and its rate
        arc = solve_ivp(fall, (0, left), start, events=lands, rtol=1e-10, atol=1e-12)
        left -= arc.t[-1] if arc.status == 1 else left
        way += radius * (np.sin(arc.y[0, -1]) + np.sin(turn / 2))
        spin = arc.y[1, -1] * (inertia + radius**2 * np.cos(turn)) / about_edge
    return float(way)


def prism(s: Variant) -> Case:
    """A cylinder of 64 sides that rolls from side to side: each side that lands takes speed."""
    sides, radius, length, rate, seconds = 64, 0.1, 0.2, 5.0, 1.0
    inertia, turn = 0.5 * radius**2, 2 * np.pi / sides
    angles = turn * (np.arange(sides) + 0.5) - np.pi / 2
    rim = radius * np.array([np.cos(angles), np.sin(angles)]).T
    corners = [(x, y, z) for y in (-length / 2, length / 2) for x, z in rim]
    around = range(1, sides + 1)
    faces = [tuple(around), tuple(sides + k for k in reversed(around))]
    faces += [(k, sides + k, sides + k % sides + 1, k % sides + 1) for k in around]
    height, edge = radius * np.cos(turn / 2), radius * np.sin(turn / 2)
    body = hull(
        "prism", (0, 0, height), corners, faces, s, mass=1.0,
        inertia=np.eye(3) * inertia * s.scale**2,
    )  # fmt: skip

    def off(run: Any, s: Variant) -> float:
        x = (run.body_pose[-1, 0, 0] - s.far) / s.scale
        return float(abs(x / rolled(sides, radius, inertia, rate, seconds) - 1.0))

    speed = rate / np.sqrt(s.scale)  # about the leading edge
    v = (speed * height * s.scale, 0.0, speed * edge * s.scale)
    return Case([body], seconds, off, 0.01, 1.0, start={"prism": (0, speed, 0, *v)})


def arch(s: Variant) -> Case:
    """Nine stones in a half circle, thicker than Milankovitch's 0.1075 of the radius."""
    count, inner, outer, depth = 9, 0.9, 1.15, 0.3
    bodies = []
    half = np.pi / count / 2
    corners = np.array(
        [[r * np.sin(a), y, r * np.cos(a)] for r in (inner, outer) for a in (-half, half)
         for y in (-depth / 2, depth / 2)]
    )  # fmt: skip
    middle = np.array([0, 0, 0.5 * (inner + outer) * np.sin(half) / half])
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    for k in range(count):
        angle = np.pi * (k + 0.5) / count - np.pi / 2
        place = middle[2] * np.array([np.sin(angle), 0, np.cos(angle)])
        bodies.append(
            hull(
                f"s{k}", place, corners - middle, faces, s, mass=50.0,
                inertia=np.eye(3) * 1.0 * s.scale**2,
                rotation=(np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0),
            )
        )  # fmt: skip
    return Case(bodies, 2.0, moved, 1e-3, friction=0.8)


def sliding(s: Variant) -> Case:
    """A square box that slides and spins on the floor, against four points of even pressure.

    Its four corners carry N = a + b x + c y, the forces of least norm that hold it level.
    """
    half, high, mu = 0.1, 0.05, 0.3
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    inertia = (2 * half) ** 2 / 6

    def rates(_t: float, y: Any) -> Any:
        turn, speed, spin = y[2], y[3:5], y[5]
        c, d = np.cos(turn), np.sin(turn)
        r = corners @ np.array([[c, d], [-d, c]])
        slip = speed + spin * np.stack([-r[:, 1], r[:, 0]], 1)
        way = -mu * slip / (np.linalg.norm(slip, axis=1)[:, None] + 1e-12)
        pressures = np.c_[np.ones(4), r]
        moments = np.array([np.ones(4), r[:, 1] + high * way[:, 1], -r[:, 0] - high * way[:, 0]])
        normal = pressures @ np.linalg.solve(moments @ pressures, [G, 0, 0])
        f = normal[:, None] * way
        torque = (r[:, 0] * f[:, 1] - r[:, 1] * f[:, 0]).sum()
        return [*speed, spin, *f.sum(axis=0), torque / inertia]

    seconds = 0.3
    want = solve_ivp(rates, (0, seconds), [0, 0, 0, 1, 0, 8], rtol=1e-9, atol=1e-11).y[:3, -1]

    def off(run: Any, s: Variant) -> float:
        place = run.body_pose[-1, 0]
        turn = 2 * np.arctan2(place[6], place[3])
        here = [(place[0] - s.far) / s.scale, place[1] / s.scale, turn]
        return float(abs((np.array(here) - want + np.pi) % (2 * np.pi) - np.pi).max())

    b = block("b", (0, 0, high), (2 * half, 2 * half, 2 * high), s)
    pace = np.sqrt(s.scale)
    return Case([b], seconds, off, 0.02, mu, start={"b": (0, 0, 8.0 / pace, pace, 0, 0)})


def kicked(s: Variant) -> Case:
    """Eight boxes on one another, the fourth kicked: what the floor can take stays in the boxes."""
    bodies = [block(f"b{k}", (0, 0, 0.2 * (k + 0.5)), (0.2,) * 3, s) for k in range(8)]
    speed = np.sqrt(s.scale)

    def off(run: Any, s: Variant) -> float:
        drift = run.v[-1].reshape(8, 6)[:, 3:5].sum(axis=0) / np.sqrt(s.scale)
        return float(max(0.0, np.hypot(*drift) - 1.0))  # friction can only take momentum away

    return Case(bodies, 0.8, off, 1e-6, 0.4, start={"b3": (0, 0, 0, speed, 0, 0)})


SCENES = {
    f.__name__: f
    for f in (
        stack, heavy, pushed, belt, turntable, dominoes, cards, house, arch, prism, sliding, kicked,
    )
}  # fmt: skip


def speed() -> None:
    """Processor time a step against MuJoCo: dominoes, a kicked stack, boxes that fall on a heap."""
    at_one = VARIANTS[0]
    row = [block(f"d{k}", (0.08 * k, 0, 0.1), (0.02, 0.1, 0.2), at_one, 0.1) for k in range(12)]
    push = (0, 6.0, 0, 0.6, 0, 0)
    compared("12 dominoes", heap(row, 0.4), 1.2, start={"d0": push})
    case = kicked(at_one)
    compared("8 boxes, one kicked", heap(case.bodies, case.friction), 0.8, start=case.start)
    dice = np.random.default_rng(0)
    places = np.indices((3, 3, 3)).reshape(3, -1).T * [0.16, 0.16, 0.2] + [0, 0, 0.12]
    boxes = []
    for k, place in enumerate(places):
        turn = dice.normal(size=4)
        box = block(f"b{k}", place, (0.1,) * 3, at_one)
        boxes.append(box.model_copy(update={"rotation": tuple(turn / np.linalg.norm(turn))}))
    compared("27 boxes", heap(boxes), 1.0)


def peer() -> None:
    """Cards and the prism in MuJoCo: how far off each is at the end, and processor time a step."""
    at_one = VARIANTS[0]
    for scene in (cards, house, prism):
        case = scene(at_one)
        model = heap(case.bodies, case.friction)
        cost, run = ours(model, case.seconds, case.start)
        other, data = theirs(model, case.seconds, case.start)
        there = SimpleNamespace(
            body_pose=np.stack([run.body_pose[0], data.qpos.reshape(-1, 7)[: len(case.bodies)]])
        )
        off = case.off(run, at_one), case.off(there, at_one)
        print(
            f"{scene.__name__}: off by {off[0]:.1e}, MuJoCo {off[1]:.1e}; {cost * 1e6:.1f} us a "
            f"step, MuJoCo {other * 1e6:.1f} us; {'; '.join(run.notices) or 'no notice'}",
            flush=True,
        )


def judged(scene: Callable[[Variant], Case], s: Variant) -> tuple[str, float, float, str]:
    """(right, told or wrong; how far off; processor seconds; the first notice)."""
    case = scene(s)
    law = {"friction": case.friction}
    contacts = [pg.Contact(name="heap", body="*", other="*", **law)]  # type: ignore[arg-type]
    if scene not in (belt, turntable):
        contacts.append(pg.Contact(name="floor", body="*", **law))  # type: ignore[arg-type]
    model = pg.Model(bodies=tuple(case.bodies), contacts=tuple(contacts), **(case.more or {}))
    mech = pg.Mechanism(model)
    q, v = mech.home()
    for name, speeds in (case.start or {}).items():
        v[mech.joints[name].v] = speeds
    pace = np.sqrt(s.scale)
    begin = time.process_time()
    run = pg.simulate(
        mech, q, v, t_end=case.seconds * pace, step=s.step * pace, frames=3, estimate=False,
        method="moreau_jean",
    )  # fmt: skip
    spent = time.process_time() - begin
    off = case.off(run, s)
    said = "; ".join(run.notices) if run.status.ok else run.message
    if run.status.ok and off <= case.close:
        return "right", off, spent, said
    return "told" if said else "wrong", off, spent, said


def main() -> None:
    """Print the table, and how many are what."""
    counts: Counter[str] = Counter()
    if sys.argv[1:] in (["speed"], ["peer"]):
        {"speed": speed, "peer": peer}[sys.argv[1]]()
        return
    for name in sys.argv[1:] or SCENES:
        for s in VARIANTS:
            verdict, off, spent, said = judged(SCENES[name], s)
            counts[verdict] += 1
            print(
                f"{name}, {s.name}: {verdict}, off by {off:.1e}, {spent:.2f} s {said:.150}",
                flush=True,
            )
    print(dict(counts))


if __name__ == "__main__":
    main()

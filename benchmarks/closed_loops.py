"""Ten closed-loop robots both ways: forward and inverse dynamics, linearisation, and their speed.

    python -m benchmarks.closed_loops [--rounds 100]

Prints, for each robot, how exactly `constrained_inverse_dynamics` gives back the torques of
`constrained_dynamics` (of all joints, of its motors alone), what it asks for in free fall, how far
eigenvalues of `linearise` are from those of differences of the motion; the frequencies of hanging
chains against the zeros of Laguerre polynomials; and processor times with Pinocchio's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from scipy.special import roots_laguerre

import pgraph_core as pg
from pgraph_core.analysis.rows import Rows
from pgraph_core.rotation import skew
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

from .machine import has, machine
from .scenes import binary_tree, differ, scene

Point = Sequence[float]
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)
DENSITY = 3.0  # kg/m of rods
BULK = 0.05  # m: least radius of gyration of a rod
CHAINS = (10, 100, 1000)
TORQUE = 10.0  # N m, N of random torques
SPEED = 0.7  # rad/s, m/s of random velocities
ASIDE = 0.15  # rad, m of random moves from the drawing


class Drawing:
    """A robot drawn at q = 0: joints at points of the world, loops closed where points meet."""

    def __init__(self, name: str, motors: Iterable[str]):
        self.name, self.motors = name, [*motors]
        self.bodies, self.ties = list[pg.Body](), list[pg.Constraint]()
        self.places = {"ground": np.zeros(3)}

    def part(
        self, name: str, parent: str, begin: Point, end: Point, axes: Any = (Y,), **fields: Any
    ) -> None:
        """A rod from its joint to its end, with hinges about these axes."""
        here, to = np.array(begin, float), np.array(end, float)
        length = float(np.linalg.norm(to - here))
        way, mass = (to - here) / length, DENSITY * length
        inertia = mass * (length**2 / 12 * (np.eye(3) - np.outer(way, way)) + BULK**2 * np.eye(3))
        if "joint" not in fields:
            fields |= {"joint": "compound", "motions": [("rotate", axis) for axis in axes]}
        self.places[name] = here
        self.bodies.append(
            pg.Body(
                name=name, parent=parent, mass=mass,
                link=here - self.places[parent], com=(to - here) / 2, inertia=inertia, **fields,
            )
        )  # fmt: skip

    def tie(self, one: str, other: str, place: Point, kind: str = "point", **fields: Any) -> None:
        """A loop closed at a point of the world."""
        at = np.array(place, float)
        self.ties.append(
            pg.Constraint(
                name=f"{one} to {other}", kind=kind, body=one, other=other,
                point=at - self.places[one], other_point=at - self.places[other], **fields,
            )
        )  # fmt: skip

    def gear(self, one: str, other: str, ratio: float) -> None:
        """Hinges that turn together."""
        self.ties.append(pg.Gear(name=f"{one} with {other}", body=one, other=other, ratio=ratio))

    def model(self) -> pg.Model:
        """The model, z up."""
        return pg.Model(name=self.name, up="z", bodies=self.bodies, constraints=self.ties)


def around(count: int, radius: float, height: float, first: float = 0.0) -> list[np.ndarray]:
    """Points on a circle."""
    angles = first + 2 * np.pi * np.arange(count) / count
    return [np.array([radius * np.cos(a), radius * np.sin(a), height]) for a in angles]


def across(point: np.ndarray) -> tuple[float, ...]:
    """The horizontal direction normal to that of a point."""
    return tuple((np.array([-point[1], point[0], 0.0]) / np.hypot(*point[:2])).tolist())


def four_bar_leg() -> Drawing:
    """A hip, and a knee that a four-bar drives."""
    d = Drawing("four-bar leg", ("thigh", "crank"))
    d.part("thigh", "ground", (0, 0, 1), (0.1, 0, 0.6))
    d.part("crank", "thigh", (0, 0, 1), (-0.12, 0, 0.96))
    d.part("shin", "thigh", (0.1, 0, 0.6), (-0.1, 0, 0.2))
    d.part("rod", "crank", (-0.12, 0, 0.96), (0.02, 0, 0.64))
    d.tie("rod", "shin", (0.02, 0, 0.64))
    return d


def pantograph() -> Drawing:
    """A leg of two parallelograms."""
    d = Drawing("pantograph leg", ("upper", "lower"))
    d.part("upper", "ground", (0, 0, 1), (0.2, 0, 0.8))
    d.part("shin", "upper", (0.2, 0, 0.8), (-0.2, 0, 0.3))
    d.part("lower", "ground", (0, 0, 0.95), (-0.08, 0, 0.8))
    d.part("link", "lower", (-0.08, 0, 0.8), (0.12, 0, 0.7))
    d.tie("link", "shin", (0.12, 0, 0.7))
    return d


def delta() -> Drawing:
    """Three arms and six rods that carry a platform."""
    d = Drawing("delta", ("arm 0", "arm 1", "arm 2"))
    hips, knees, ends = around(3, 0.3, 1.0), around(3, 0.55, 0.85), around(3, 0.1, 0.3)
    d.part("platform", "ground", (0, 0, 0.3), (0, 0, 0.25), joint="free")
    for k in range(3):
        side = np.array(across(hips[k])) * 0.06
        d.part(f"arm {k}", "ground", hips[k], knees[k], (across(hips[k]),))
        for s, word in ((-1, "left"), (1, "right")):
            axes = (across(hips[k]), (hips[k] / np.linalg.norm(hips[k] * (1, 1, 0)) * (1, 1, 0)))
            d.part(f"{word} rod {k}", f"arm {k}", knees[k] + s * side, ends[k] + s * side, axes)
            d.tie(f"{word} rod {k}", "platform", ends[k] + s * side)
    return d


def stewart() -> Drawing:
    """A platform on six legs that grow."""
    d = Drawing("Stewart platform", [f"leg {k}" for k in range(6)])
    feet, tops = around(6, 0.6, 0.0, 0.2), around(6, 0.4, 0.7, -0.15)
    tops = [tops[(k + k % 2) % 6] for k in range(6)]
    tops = [t + 0.03 * np.array(across(t)) * (-1) ** k for k, t in enumerate(tops)]
    d.part("platform", "ground", (0, 0, 0.7), (0, 0, 0.75), joint="free")
    for k, (foot, top) in enumerate(zip(feet, tops)):
        half, way = (foot + top) / 2, (top - foot) / np.linalg.norm(top - foot)
        d.part(f"cylinder {k}", "ground", foot, half, (X, Y))
        d.part(
            f"leg {k}", f"cylinder {k}", half, top, joint="compound", motions=[("translate", way)]
        )
        d.tie(f"leg {k}", "platform", top)
    return d


def gripper() -> Drawing:
    """Two fingers, each a four-bar, whose drivers a gear keeps together (as a Robotiq 2F-85)."""
    d = Drawing("two-finger gripper", ("left driver",))
    for s, word in ((-1, "left"), (1, "right")):
        d.part(f"{word} driver", "ground", (s * 0.03, 0, 0), (s * 0.08, 0, 0.03))
        d.part(f"{word} coupler", f"{word} driver", (s * 0.08, 0, 0.03), (s * 0.07, 0, 0.08))
        d.part(f"{word} follower", "ground", (s * 0.013, 0, 0.06), (s * 0.055, 0, 0.095))
        d.tie(f"{word} coupler", f"{word} follower", (s * 0.07, 0, 0.08))
    d.gear("right driver", "left driver", -1.0)
    return d


def cassie() -> Drawing:
    """A biped on both toes: legs with spring shins, Achilles rods and plantar rods."""
    legs = ("roll", "yaw", "hip", "knee", "crank")
    d = Drawing("Cassie-like biped", [f"{s} {j}" for s in ("left", "right") for j in legs])
    d.part("pelvis", "ground", (0, 0, 1), (0, 0, 1.1), joint="free")
    for s, y in (("left", 0.13), ("right", -0.13)):
        d.part(f"{s} roll", "pelvis", (0, y, 1), (0.02, y, 0.96), (X,))
        d.part(f"{s} yaw", f"{s} roll", (0.02, y, 0.96), (0.02, y, 0.9), (Z,))
        d.part(f"{s} hip", f"{s} yaw", (0.02, y, 0.9), (0.14, y, 0.8))
        d.part(f"{s} knee", f"{s} hip", (0.14, y, 0.8), (0.14, y, 0.72))
        spring = {"stiffness": (1500.0,), "damping": (2.0,)}
        d.part(f"{s} shin", f"{s} knee", (0.14, y, 0.72), (0.0, y, 0.42), **spring)
        d.part(f"{s} tarsus", f"{s} shin", (0.0, y, 0.42), (0.1, y, 0.1))
        d.part(f"{s} achilles", f"{s} hip", (0.0, y + 0.04, 0.88), (-0.08, y + 0.03, 0.45), (Y, X))
        d.tie(f"{s} achilles", f"{s} tarsus", (-0.08, y + 0.03, 0.45))
        d.part(f"{s} crank", f"{s} tarsus", (0.02, y, 0.36), (0.07, y, 0.35))
        d.part(f"{s} plantar", f"{s} crank", (0.07, y, 0.35), (0.15, y, 0.12))
        d.part(f"{s} foot", f"{s} tarsus", (0.1, y, 0.1), (0.2, y, 0.05))
        d.tie(f"{s} plantar", f"{s} foot", (0.15, y, 0.12))
        d.tie(f"{s} foot", "ground", (0.2, y, 0.05))
    return d


def five_bar() -> Drawing:
    """A planar arm with both motors at its base."""
    d = Drawing("five-bar arm", ("left arm", "right arm"))
    for s, word in ((-1, "left"), (1, "right")):
        d.part(f"{word} arm", "ground", (s * 0.1, 0, 0), (s * 0.25, 0.2, 0), (Z,))
    d.part("left rod", "left arm", (-0.25, 0.2, 0), (0, 0.45, 0), (Z,))
    d.part("right rod", "right arm", (0.25, 0.2, 0), (0, 0.45, 0), (Z,))
    d.tie("left rod", "right rod", (0, 0.45, 0))
    return d


def planar_3rrr() -> Drawing:
    """Three arms of two links that move a plate in its plane."""
    d = Drawing("3-RRR plate", ("crank 0", "crank 1", "crank 2"))
    d.part(
        "plate", "ground", (0, 0, 0), (0, 0, 0.02), joint="planar",
        motions=[("translate", X), ("translate", Y), ("rotate", Z)],
    )  # fmt: skip
    hips, knees = around(3, 0.5, 0.0), around(3, 0.4, 0.0, 0.6)
    for k, end in enumerate(around(3, 0.12, 0.0, 0.1)):
        d.part(f"crank {k}", "ground", hips[k], knees[k], (Z,))
        d.part(f"rod {k}", f"crank {k}", knees[k], end, (Z,))
        d.tie(f"rod {k}", "plate", end)
    return d


def crane() -> Drawing:
    """A boom and a stick on hydraulic cylinders, on a turntable."""
    d = Drawing("crane", ("column", "first piston", "second piston"))
    d.part("column", "ground", (0, 0, 0), (0, 0, 1), (Z,))
    d.part("boom", "column", (0, 0, 1), (1, 0, 1.6))
    d.part("stick", "boom", (1, 0, 1.6), (1.8, 0, 1.2))
    for word, base, foot, body, head in (
        ("first", "column", (0.15, 0, 0.5), "boom", (0.45, 0, 1.25)),
        ("second", "boom", (0.4, 0, 1.4), "stick", (1.1, 0, 1.75)),
    ):
        half = (np.array(foot) + head) / 2
        way = np.subtract(head, foot) / np.linalg.norm(np.subtract(head, foot))
        d.part(f"{word} cylinder", base, foot, half)
        d.part(
            f"{word} piston",
            f"{word} cylinder",
            half,
            head,
            joint="compound",
            motions=[("translate", way)],
        )
        d.tie(f"{word} piston", body, head)
    return d


def parallel_ankle() -> Drawing:
    """A foot that two cranks in the shin turn about two axes, by rods (as of humanoids)."""
    d = Drawing("parallel ankle", ("knee", "left crank", "right crank"))
    d.part("knee", "ground", (0, 0, 0.5), (0, 0, 0.1))
    d.part("foot", "knee", (0, 0, 0.08), (0.12, 0, 0), (Y, X))
    for y, word in ((0.04, "left"), (-0.04, "right")):
        d.part(f"{word} crank", "knee", (0, y, 0.3), (-0.05, y, 0.3))
        d.part(f"{word} rod", f"{word} crank", (-0.05, y, 0.3), (-0.05, y, 0.06), (Y, X))
        d.tie(f"{word} rod", "foot", (-0.05, y, 0.06))
    return d


ROBOTS = (
    four_bar_leg, pantograph, delta, stewart, gripper, cassie, five_bar, planar_3rrr, crane,
    parallel_ankle,
)  # fmt: skip


def moving(mech: pg.Mechanism, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) a random state that its loops allow."""
    rng = np.random.default_rng(seed)
    rows = Rows.of(mech, mech.packed.active, mech.home()[0])
    q = rows.advanced(ASIDE * rng.uniform(-1, 1, mech.nv))
    q, v, _ = mech.assemble(q, SPEED * rng.normal(size=mech.nv))
    return q, v


def torques_back(mech: pg.Mechanism, motors: Sequence[str]) -> tuple[float, float, float]:
    """Largest errors of torques given back: of all joints, of the motors, and in free fall.

    Relative to the torques given; of all joints without the part that the loops take.
    """
    q, v = moving(mech)
    given = TORQUE * np.random.default_rng(1).normal(size=mech.nv)
    J = Rows.of(mech, mech.packed.active, q).J
    reached = given - J.T @ np.linalg.lstsq(J.T, given, rcond=1e-9)[0]
    found = mech.constrained_inverse_dynamics(q, v, mech.constrained_dynamics(q, v, given)[0])
    driven = [k for name in motors for k in range(mech.nv)[mech.joints[name].v]]
    alone = np.zeros(mech.nv)
    alone[driven] = given[driven]
    vdot = mech.constrained_dynamics(q, v, alone)[0]
    again = mech.constrained_inverse_dynamics(q, v, vdot, actuated=motors)
    fall = mech.constrained_inverse_dynamics(q, v, mech.constrained_dynamics(q, v)[0])
    size = np.abs(given).max()
    return tuple(float(np.abs(x).max() / size) for x in (found - reached, again - alone, fall))


def eigenvalues_off(mech: pg.Mechanism) -> float:
    """Largest error of the eigenvalues of `linearise`, against those of the motion's differences.

    Differences of fourth order along states that Newton's method puts onto the loops.
    """
    q, v = moving(mech)
    line = mech.linearise(q, v)
    index, speed = (
        [_number(mech, name) for name in x] for x in (line.coordinates, line.velocities)
    )
    start = Rows.of(mech, mech.packed.active, q, v)
    n, m, axes = len(index), len(speed), np.eye(mech.nv)

    def rate(x: np.ndarray) -> np.ndarray:
        at, passed = start.advanced(line.moves @ x[:n]), line.moves @ x[:n]
        for _ in range(6):  # the loops closed at exactly these independent coordinates
            here = start.at(at)
            step = -np.linalg.lstsq(
                np.vstack((here.J, axes[index])),
                np.concatenate((here.gap, np.zeros(n))),
                rcond=1e-10,
            )[0]
            at, passed = here.advanced(step), passed + step
        here = start.at(at)
        wanted = np.concatenate((np.zeros(len(here.J)), v[speed] + x[n:]))
        u = np.linalg.lstsq(np.vstack((here.J, axes[speed])), wanted, rcond=1e-10)[0]
        vdot, _ = mech.constrained_dynamics(at, u)
        return np.concatenate(((u + spin @ passed)[index], vdot[speed]))

    spin = np.zeros((mech.nv, mech.nv))  # rotation vectors turn along: δθ' = δω + ω × δθ
    for body in mech.model.bodies:
        if body.joint == "free":
            k = mech.joints[body.name].v.start
            spin[k : k + 3, k : k + 3] = skew(v[k : k + 3])
    h = 1e-3
    columns = [
        (8 * (rate(h * e) - rate(-h * e)) - (rate(2 * h * e) - rate(-2 * h * e))) / (12 * h)
        for e in np.eye(n + m)
    ]
    expected = np.linalg.eigvals(np.array(columns).T)
    found = np.linalg.eigvals(line.A)
    apart = np.abs(found[:, None] - expected[None])
    return float(apart.min(axis=1).max() / np.abs(expected).max())


def _number(mech: pg.Mechanism, name: str) -> int:
    body, _, k = name.partition("[")
    return mech.joints[body].v.start + (int(k[:-1]) if k else 0)


def chain_off(n: int) -> float:
    """Largest relative error of the frequencies of n point masses that hang on links of 1 m."""
    none = ((0.0,) * 3,) * 3
    bodies = [
        pg.Body(
            name=str(k), parent=str(k - 1) if k else "ground", axes=(Y,), mass=1.0, inertia=none,
            link=(0, 0, -1) if k else (0, 0, 0), com=(0, 0, -1),
        )
        for k in range(n)
    ]  # fmt: skip
    mech = pg.Mechanism(pg.Model(up="z", gravity=(0, 0, -9.81), bodies=bodies))
    expected = np.sqrt(9.81 * laguerre(n))
    return float(np.abs(mech.linearise().frequencies / expected - 1).max())


def laguerre(n: int) -> np.ndarray:
    """Zeros of the Laguerre polynomial L_n, ascending."""
    if n < 150:
        return roots_laguerre(n)[0]
    from scipy.linalg import eigh_tridiagonal

    main = 2.0 * np.arange(n) + 1.0
    return np.asarray(eigh_tridiagonal(main, np.arange(1.0, n), eigvals_only=True))


# -- speed -----------------------------------------------------------------------------------------


def least(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Least processor time of a call [s], the calls taken in turn."""
    found = dict.fromkeys(calls, np.inf)
    for _ in range(rounds):
        for name, call in calls.items():
            began = time.thread_time()
            for _ in range(20):
                call()
            found[name] = min(found[name], (time.thread_time() - began) / 20)
    return found


def inverse_in_pinocchio(
    model: pg.Model, q: np.ndarray, v: np.ndarray, vdot: np.ndarray
) -> Callable[[], np.ndarray]:
    """Its nearest: RNEA, the constraints' Jacobian, and the part of the torques normal to it."""
    pin: Any = import_module("pinocchio")
    rows = rows_of(model, pg.Topology.of(model))
    tree, frames, _ = in_pinocchio.build(model, rows)
    data = tree.createData()
    position, T, drift = in_pinocchio.coordinates(rows, q, v)
    velocity, acceleration = T @ v, T @ vdot + drift

    def end(name: str, point: Any) -> tuple[int, Any]:
        at = pin.SE3(np.eye(3), np.array(point))
        if name == "ground":
            return 0, at
        frame = tree.frames[frames[name]]
        return frame.parentJoint, frame.placement * at

    points = [(*end(c.body, c.point), end(c.other, c.other_point)) for c in model.constraints]
    made, kept = in_pinocchio.pinned(tree, data, points)
    # its Jacobian takes the constraints' places from here: once, since they stay
    settings = pin.ProximalSettings(*in_pinocchio.QUICK)
    zero = np.zeros(tree.nv)
    pin.constraintDynamics(tree, data, position, velocity, zero, made, kept, settings)

    def torques() -> np.ndarray:
        force = pin.rnea(tree, data, position, velocity, acceleration)
        pin.computeJointJacobians(tree, data, position)
        J = pin.getConstraintsJacobian(tree, data, made, kept)
        return force - J.T @ np.linalg.lstsq(J.T, force, rcond=1e-10)[0]

    if np.array_equal(T, np.eye(len(v))):  # without balls and free joints: the same coordinates
        mine = pg.Mechanism(model).constrained_inverse_dynamics(q, v, vdot)
        differ(torques(), mine, 1e-9, model.name)
    return torques


def inverse_times(rounds: int) -> None:
    """Print what `constrained_inverse_dynamics` takes."""
    print("\n| torques of | pgraph | pinocchio, numpy | ratio |\n|---|---|---|---|")
    for make in ROBOTS:
        model = make().model()
        if any(isinstance(c, pg.Gear) for c in model.constraints):
            continue  # Pinocchio's constraints are of points and poses
        mech = pg.Mechanism(model)
        q, v = moving(mech)
        vdot, _ = mech.constrained_dynamics(q, v, np.ones(mech.nv))
        calls: dict[str, Callable[[], object]] = {
            "ours": partial(mech.constrained_inverse_dynamics, q, v, vdot),
            "theirs": inverse_in_pinocchio(model, q, v, vdot),
        }
        show(model.name, least(calls, rounds))


def derivative_times(rounds: int) -> None:
    """Print what `forward_derivatives` takes."""
    print("\n| derivatives of | pgraph | computeABADerivatives | ratio |\n|---|---|---|---|")
    chains = {f"chain of {n}": pg.Model.serial(n) for n in (4, 7, 10, 30, 100)}
    trees = {f"binary tree of {n}": binary_tree(n) for n in (15, 31, 63)}
    for name, model in (chains | trees).items():
        place = scene(name, model)
        mech, (_, _, q, v, tau, *_) = pg.Mechanism(model), place.state
        theirs, expected = in_pinocchio.derivatives(place)
        differ(np.stack(mech.forward_derivatives(q, v, tau)), expected, 1e-9, name)
        calls: dict[str, Callable[[], object]] = {
            "ours": partial(mech.forward_derivatives, q, v, tau),
            "theirs": theirs,
        }
        show(name, least(calls, rounds))


def show(name: str, found: dict[str, float]) -> None:
    """A row of a table."""
    ours, theirs = found.values()
    print(f"| {name} | {1e6 * ours:.1f} us | {1e6 * theirs:.1f} us | {theirs / ours:.2f} |")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=100)
    rounds = parser.parse_args().rounds
    print(machine())
    print("\n| robot | freedoms | mobility | all joints | motors | free fall | eigenvalues |")
    print("|---|---|---|---|---|---|---|")
    for make in ROBOTS:
        drawing = make()
        mech = pg.Mechanism(drawing.model())
        freedoms = mech.mobility(moving(mech)[0]).dof
        errors = *torques_back(mech, drawing.motors), eigenvalues_off(mech)
        cells = " | ".join(f"{x:.0e}" for x in errors)
        print(f"| {drawing.name} | {mech.nv} | {freedoms} | {cells} |")
    print("\n| hanging chain | largest relative error of a frequency |\n|---|---|")
    for n in CHAINS:
        print(f"| {n} | {chain_off(n):.1e} |")
    if has("pin"):
        inverse_times(rounds)
        derivative_times(rounds)


if __name__ == "__main__":
    main()

"""Inverse dynamics of closed loops and derivatives of trees against Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import pgraph_core as pg
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

from .machine import has
from .measure import Effort, Row, compared, differ
from .scenes import binary_tree, built_in, scene

MINUTES = 1.0
PEERS = ("pin",)
X, Y = (1, 0, 0), (0, 1, 0)


def rows(effort: Effort) -> Iterator[Row]:
    for model in (built_in("four_bar"), delta(), stewart())[: effort.pick(3, 1)]:
        yield from inverse(effort, model)
    chains = {f"chain of {n}": pg.Model.serial(n) for n in effort.pick((4, 7, 10, 30, 100), (4,))}
    trees = {f"tree of {n}": binary_tree(n) for n in effort.pick((15, 31, 63), (3,))}
    for name, model in (chains | trees).items():
        yield from derivatives(effort, name, model)


def inverse(effort: Effort, model: pg.Model) -> Iterator[Row]:
    """Torques that make a motion which the loops allow."""
    mech = pg.Mechanism(model)
    q, v = mech.home()
    q, v, _ = mech.assemble(q, 0.3 * np.random.default_rng(0).normal(size=mech.nv))
    given = 10.0 * np.random.default_rng(1).normal(size=mech.nv)
    vdot, _ = mech.constrained_dynamics(q, v, given)
    found = mech.constrained_inverse_dynamics(q, v, vdot)
    again, _ = mech.constrained_dynamics(q, v, found)
    error = differ(again, vdot, 1e-8, model.name)
    ours = partial(mech.constrained_inverse_dynamics, q, v, vdot)
    sides: dict[str, Callable[[], object]] = {"pgraph": ours}
    if has("pin"):
        sides["pinocchio, numpy"] = inverse_in_pinocchio(model, q, v, vdot)
    name = f"torques, {model.name}"
    return compared(effort, name, sides, agrees=f"the motion again {error}")


def inverse_in_pinocchio(
    model: pg.Model, q: np.ndarray, v: np.ndarray, vdot: np.ndarray
) -> Callable[[], np.ndarray]:
    """Its nearest: RNEA, the constraints' Jacobian, and the part of the torques normal to it."""
    import pinocchio as pin

    rows = rows_of(model, pg.Topology.of(model))
    tree, frames, _ = in_pinocchio.build(model, rows)
    data = tree.createData()
    position, T, drift = in_pinocchio.coordinates(rows, q, v)
    velocity, acceleration = T @ v, T @ vdot + drift

    def end(name: str, point: tuple[float, ...]) -> tuple[int, pin.SE3]:
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


def derivatives(effort: Effort, name: str, model: pg.Model) -> Iterator[Row]:
    """∂v'/∂q, ∂v'/∂v and ∂v'/∂τ."""
    place = scene(name, model)
    mech, (_, _, q, v, tau, *_) = pg.Mechanism(model), place.state
    sides: dict[str, Callable[[], object]] = {
        "pgraph": partial(mech.forward_derivatives, q, v, tau)
    }
    agrees = ""
    if has("pin"):
        sides["pin.computeABADerivatives"], theirs = in_pinocchio.derivatives(place)
        found = np.stack(mech.forward_derivatives(q, v, tau))
        agrees = f"pin {differ(found, theirs, 1e-9, name)}"
    return compared(effort, f"derivatives, {name}", sides, agrees=agrees)


# -- parallel robots, drawn at q = 0 ---------------------------------------------------------------


class Drawing:
    """Joints at points of the world; loops are closed where points meet."""

    def __init__(self) -> None:
        self.bodies, self.ties = list[pg.Body](), list[pg.Constraint]()
        self.places = {"ground": np.zeros(3)}

    def part(self, name: str, parent: str, begin: np.ndarray, end: np.ndarray, axes=(),
             **joint) -> None:  # fmt: skip
        """A rod of 3 kg/m from its joint to its end."""
        length = float(np.linalg.norm(end - begin))
        way, mass = (end - begin) / length, 3.0 * length
        inertia = mass * (length**2 / 12 * (np.eye(3) - np.outer(way, way)) + 0.0025 * np.eye(3))
        joint = joint or {"joint": "compound", "motions": [("rotate", axis) for axis in axes]}
        self.places[name] = begin
        link, com = begin - self.places[parent], (end - begin) / 2
        body = {"mass": mass, "link": link, "com": com, "inertia": inertia, **joint}
        self.bodies.append(pg.Body(name=name, parent=parent, **body))

    def tie(self, one: str, other: str, at: np.ndarray) -> None:
        """Two points of bodies that stay together."""
        points = {"point": at - self.places[one], "other_point": at - self.places[other]}
        self.ties.append(pg.Constraint(name=f"{one} to {other}", body=one, other=other, **points))

    def model(self, name: str) -> pg.Model:
        return pg.Model(name=name, up="z", bodies=self.bodies, constraints=self.ties)


def around(count: int, radius: float, height: float, first: float = 0.0) -> list[np.ndarray]:
    """Points on a circle."""
    angles = first + 2 * np.pi * np.arange(count) / count
    return [np.array([radius * np.cos(a), radius * np.sin(a), height]) for a in angles]


def across(point: np.ndarray) -> tuple[float, ...]:
    """The horizontal direction normal to that of a point."""
    return tuple((np.array([-point[1], point[0], 0.0]) / np.hypot(*point[:2])).tolist())


def delta() -> pg.Model:
    """Three arms and six rods that carry a platform."""
    d = Drawing()
    hips, knees, ends = around(3, 0.3, 1.0), around(3, 0.55, 0.85), around(3, 0.1, 0.3)
    d.part("platform", "ground", np.array([0, 0, 0.3]), np.array([0, 0, 0.25]), joint="free")
    for k in range(3):
        side, out = np.array(across(hips[k])), hips[k] * (1, 1, 0)
        d.part(f"arm {k}", "ground", hips[k], knees[k], (across(hips[k]),))
        for s, word in ((-0.06, "left"), (0.06, "right")):
            axes = (across(hips[k]), out / np.linalg.norm(out))
            d.part(f"{word} rod {k}", f"arm {k}", knees[k] + s * side, ends[k] + s * side, axes)
            d.tie(f"{word} rod {k}", "platform", ends[k] + s * side)
    return d.model("delta")


def stewart() -> pg.Model:
    """A platform on six legs that grow."""
    d = Drawing()
    feet, tops = around(6, 0.6, 0.0, 0.2), around(6, 0.4, 0.7, -0.15)
    tops = [tops[(k + k % 2) % 6] for k in range(6)]
    tops = [t + 0.03 * np.array(across(t)) * (-1) ** k for k, t in enumerate(tops)]
    d.part("platform", "ground", np.array([0, 0, 0.7]), np.array([0, 0, 0.75]), joint="free")
    for k, (foot, top) in enumerate(zip(feet, tops)):
        half, way = (foot + top) / 2, (top - foot) / np.linalg.norm(top - foot)
        grows = {"joint": "compound", "motions": [("translate", way)]}
        d.part(f"cylinder {k}", "ground", foot, half, (X, Y))
        d.part(f"leg {k}", f"cylinder {k}", half, top, **grows)
        d.tie(f"leg {k}", "platform", top)
    return d.model("Stewart platform")

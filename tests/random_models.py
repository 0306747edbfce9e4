"""Random trees and forests of every kind of joint, and states for them."""

from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.paper import bodies_of
from pgraph_core.rotation import unit


class State(NamedTuple):
    """A model with a state and forces, all in number order."""

    model: pg.Model
    topology: pg.Topology
    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray
    vdot: np.ndarray
    external: np.ndarray  # (nb, 6) on the bodies at their origins, world axes


KINDS = (
    "weld",
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "planar",
    "spherical",
    "free",
    "compound",
)
COMPOUNDS = (
    ("ball", "translate"),
    ("translate", "ball"),
    ("ball", "translate", "translate"),
    ("rotate", "translate", "ball"),
    ("rotate", "rotate", "rotate"),
    ("translate", "rotate", "translate", "rotate"),
    ("ball", "translate", "rotate", "translate"),
)


def random_model(rng, nb, kinds=KINDS, roots=1, armature=True):
    """Return a forest of `nb` bodies, each attached to an earlier row or the ground."""
    bodies = []
    for i in range(nb):
        parent = "ground" if i < roots else f"b{rng.integers(max(0, i - 4), i)}"
        kind = str(rng.choice(["free", "revolute"] if i == 0 and "free" in kinds else kinds))
        if kind == "weld" and i == nb - 1:
            kind = "revolute"
        bodies.append(random_body(rng, f"b{i}", parent, kind, armature))
    return pg.Model(name="random", bodies=tuple(bodies), gravity=tuple(rng.normal(0, 6, 3)))


def random_body(rng, name, parent, kind, armature=True):
    """A body with random geometry, mass properties and joint."""
    motions = [m.kind for m in joints.DEFAULT[kind]]
    if kind == "compound":
        motions = COMPOUNDS[rng.integers(len(COMPOUNDS))]
    pairs = tuple((m, tuple(rng.normal(size=3))) for m in motions)
    added = [
        rng.uniform(0, 0.2) if m in ("rotate", "translate") else 0.1 * abs(axis[0])
        for m, axis in pairs
    ]
    if kind == "free" and parent != "ground":
        added = [0.0]
    points = rng.normal(size=(6, 3)) * rng.uniform(0.1, 0.5, 3)
    points -= points.mean(axis=0)
    mass = float(rng.uniform(0.5, 3))
    spread = points.T @ points
    inertia = mass / 6 * (np.trace(spread) * np.eye(3) - spread)
    return pg.Body(
        name=name,
        parent=parent,
        joint=kind,
        motions=pairs,
        link=tuple(rng.normal(0, 0.5, 3)),
        rotation=random_quaternion(rng),
        mass=mass,
        com=tuple(rng.normal(0, 0.2, 3)),
        inertia=(inertia + inertia.T) / 2,
        tip=tuple(rng.normal(0, 0.3, 3)),
        armature=tuple(added) if armature and rng.random() < 0.3 else (0.0,) * len(added),
    )


def random_quaternion(rng):
    """Uniform on the unit sphere."""
    return unit(rng.normal(size=4))


def random_state(rng, model):
    """Random q with unit quaternions, v, tau, vdot and external forces for a model."""
    topology = pg.Topology.of(model)
    q = []
    for body in bodies_of(model, topology):
        for motion in body.sequence:
            if motion.kind == "free":
                q += list(rng.normal(0, 0.5, 3))
            if motion.kind in ("ball", "free"):
                q += random_quaternion(rng)
            else:
                q.append(rng.uniform(-2, 2))
    nv = int(topology.dof.sum())
    v, tau, vdot = rng.normal(size=(3, nv)) * np.array([[1.5], [5.0], [3.0]])
    external = rng.normal(0, 3, (topology.nb, 6))
    return State(model, topology, np.array(q), v, tau, vdot, external)


def random_case(seed, kinds=KINDS, most=12):
    """The model and state of a seed: 1 to `most` bodies, up to three roots."""
    rng = np.random.default_rng(seed)
    nb = int(rng.integers(1, most + 1))
    model = random_model(rng, nb, kinds, roots=int(rng.integers(1, min(3, nb) + 1)))
    return random_state(rng, model)

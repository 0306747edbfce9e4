"""Distances of pairs of shapes, and from the ground, by MuJoCo; shapes and poses are drawn here.

Nothing of ours is run. A hull goes to MuJoCo as the mesh of its points.
"""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

KINDS = ("sphere", "capsule", "box", "cylinder", "hull")
POINTS = 12  # of a hull
SETS = 8  # placings of every pair of kinds
SPREADS = (0.1, 0.4, 1.0)  # deep, touching, apart
FAR = 10.0

HEAD = '<mujoco><option ccd_tolerance="1e-14" ccd_iterations="500"/>'


def contacts() -> dict[str, np.ndarray]:
    """sizes (n, 2, 3), points (n, 2, POINTS, 3), poses (n, 2, 7), distance (n,), ground (n, 2)."""
    rng = np.random.default_rng(4)
    pairs = list(itertools.product(range(len(KINDS)), repeat=2)) * SETS
    count = len(pairs)
    spread = np.array(SPREADS)[np.arange(count) % len(SPREADS)]
    sizes = rng.uniform(0.1, 0.4, (count, 2, 3))
    points = rng.normal(size=(count, 2, POINTS, 3)) * 0.3
    points -= points.mean(axis=2, keepdims=True)
    poses = np.zeros((count, 2, 7))
    poses[:, :, :3] = rng.normal(size=(count, 2, 3)) * spread[:, None, None]
    turns = Rotation.random(2 * count, rng=rng).as_quat(scalar_first=True)
    poses[:, :, 3:] = turns.reshape(count, 2, 4)
    found = [measured(*case) for case in zip(pairs, sizes, points, poses)]
    return {
        "pairs": np.array(pairs),
        "sizes": sizes,
        "points": points,
        "poses": poses,
        "distance": np.array([distance for distance, _ in found]),
        "ground": np.array([ground for _, ground in found]),
    }


def measured(pair, sizes, points, poses) -> tuple[float, list[float]]:
    """Distance of the two geoms, and the least gap of each from the plane z = 0."""
    meshes = "".join(
        f'<mesh name="m{i}" vertex="{_text(points[i].ravel())}" inertia="convex"/>'
        for i in range(2)
    )
    geoms = "".join(_geom(i, KINDS[pair[i]], sizes[i], poses[i]) for i in range(2))
    plane = '<geom name="plane" type="plane" size="5 5 1" margin="10"/>'
    text = f"{HEAD}<asset>{meshes}</asset><worldbody>{plane}{geoms}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    a, b = model.geom("g0").id, model.geom("g1").id
    distance = mujoco.mj_geomDistance(model, data, a, b, FAR, None)
    ground = []
    for geom in (a, b):
        gaps = [c.dist for c in data.contact if set(c.geom) == {geom, model.geom("plane").id}]
        ground.append(min(gaps))
    return distance, ground


def _geom(i: int, kind: str, size: np.ndarray, pose: np.ndarray) -> str:
    used = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "hull": 0}[kind]
    form = f'type="mesh" mesh="m{i}"' if kind == "hull" else f'type="{kind}"'
    given = f' size="{_text(size[:used])}"' if used else ""
    place = f'pos="{_text(pose[:3])}" quat="{_text(pose[3:])}"'
    return f'<body {place}><freejoint/><geom name="g{i}" {form}{given} margin="10"/></body>'


def _text(numbers) -> str:
    return " ".join(repr(float(x)) for x in numbers)

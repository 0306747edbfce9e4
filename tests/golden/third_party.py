"""Remake third_party.json and .npz: models of other authors, and their dynamics.

    pip install --target PLACE --no-deps gymnasium example-robot-data
    python -m tests.golden.third_party PLACE

MuJoCo reads the MJCF files and Pinocchio the URDF files, and both compute; contacts, limits,
actuators, springs, dampers and fluids are switched off, armature stays. The files kept here hold
the models' numbers (masses, lengths, axes) as tables of ours, no text of theirs.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import distributions, version
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_core.rotation import matrix

HERE = Path(__file__).parent
MJCF = "gymnasium/envs/mujoco/assets"
URDF = "cmeel.prefix/share/example-robot-data/robots"
MIT, BSD3, APACHE = "MIT (gymnasium)", "BSD-3-Clause", "Apache-2.0"  # as the packages say


class Source(NamedTuple):
    file: str
    licence: str
    free: bool = False  # a URDF's root, where the file leaves it open


SOURCES = {
    **{
        name: Source(f"{MJCF}/{name}.xml", MIT)
        for name in (
            "ant",
            "half_cheetah",
            "hopper",
            "humanoid",
            "inverted_double_pendulum",
            "pusher_v5",
            "reacher",
            "swimmer",
            "walker2d_v5",
        )
    },
    "panda": Source(f"{URDF}/panda_description/urdf/panda.urdf", APACHE),
    "anymal_c": Source(f"{URDF}/anymal_c_simple_description/urdf/anymal.urdf", BSD3, True),
    "baxter": Source(f"{URDF}/baxter_description/urdf/baxter.urdf", BSD3),
    "alexander_legs": Source(
        f"{URDF}/alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", APACHE, True
    ),
}


class Case(NamedTuple):
    """A model and its numbers by the oracle, in our conventions and number order."""

    model: pg.Model
    numbers: dict[str, np.ndarray]


def body(name, parent, motions, *, turn, shift, mass, com, inertia, armature) -> pg.Body:
    """A body from the oracle's numbers; `turn` is a matrix."""
    kinds = tuple(kind for kind, _ in motions)
    joint = {(): "weld", ("free",): "free"}.get(kinds, "compound")
    return pg.Body(
        name=name,
        parent=parent,
        joint=joint,
        motions=tuple((kind, tuple(axis)) for kind, axis in motions),
        link=tuple(shift),
        rotation=tuple(Rotation.from_matrix(turn).as_quat(scalar_first=True)),
        mass=float(mass),
        com=tuple(com),
        inertia=(inertia + inertia.T) / 2,
        armature=tuple(armature),
    )


def random_numbers(rng, model):
    """q, v, tau of a model in number order."""
    mech = pg.Mechanism(model)
    q = rng.uniform(-1, 1, mech.nq)
    if len(model.bodies) and model.bodies[0].joint == "free":
        q[3:7] /= np.linalg.norm(q[3:7])
    return q, rng.normal(0, 1.5, mech.nv), rng.normal(0, 5, mech.nv)


# -- MuJoCo ------------------------------------------------------------------------------------


def from_mujoco(path: Path, rng) -> Case:
    m = mujoco.MjModel.from_xml_path(str(path))
    tree_only(m)
    bodies, order = [], []
    pivot = [common_pivot(m, b) for b in range(m.nbody)]
    for b in range(1, m.nbody):
        joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
        kinds = {0: "free", 2: "translate", 3: "rotate"}
        motions = [(kinds[int(m.jnt_type[j])], m.jnt_axis[j]) for j in joints]
        free = [kind for kind, _ in motions] == ["free"]
        turn = np.eye(3) if free else matrix(m.body_quat[b])
        parent = int(m.body_parentid[b])
        about = matrix(m.body_iquat[b])
        bodies.append(
            body(
                f"{b} {m.body(b).name}".strip(),
                f"{parent} {m.body(parent).name}".strip() if parent else "ground",
                motions,
                turn=turn,
                shift=0 * turn[0] if free else m.body_pos[b] + turn @ pivot[b] - pivot[parent],
                mass=m.body_mass[b],
                com=m.body_ipos[b] - pivot[b],
                inertia=about @ np.diag(m.body_inertia[b]) @ about.T,
                armature=[m.dof_armature[m.jnt_dofadr[j]] for j in joints],
            )
        )
        order.append(bodies[-1].name)
    model = pg.Model(name=path.stem, bodies=tuple(bodies), gravity=tuple(m.opt.gravity))
    assert pg.Topology.of(model).names == tuple(order)  # both are depth-first
    q, v, tau = random_numbers(rng, model)
    return Case(model, {"q": q, "v": v, "tau": tau, **by_mujoco(m, q, v, tau)})


def tree_only(m) -> None:
    """Leave inertia, gravity and armature."""
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    m.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    m.dof_damping[:] = 0
    m.jnt_stiffness[:] = 0
    m.opt.density = m.opt.viscosity = 0
    assert not m.ntendon or not (m.tendon_stiffness.any() or m.tendon_damping.any())


def common_pivot(m, b) -> np.ndarray:
    """The place of a body's hinges in its axes: our origin."""
    joints = range(m.body_jntadr[b], m.body_jntadr[b] + m.body_jntnum[b])
    places = [m.jnt_pos[j] for j in joints if m.jnt_type[j] == 3]
    assert all(np.array_equal(place, places[0]) for place in places)
    return places[0].copy() if places else np.zeros(3)


def by_mujoco(m, q, v, tau) -> dict[str, np.ndarray]:
    data, T = mujoco.MjData(m), np.eye(m.nv)
    data.qpos[:] = q
    if m.jnt_type[0] == 0:
        T[:6, :6] = np.block([[np.zeros((3, 3)), np.eye(3)], [matrix(q[3:7]).T, np.zeros((3, 3))]])
    else:
        data.qpos[:] += m.qpos0  # MuJoCo counts from its `ref`
    data.qvel[:] = T @ v
    data.qfrc_applied[:] = T @ tau  # T is orthogonal
    mujoco.mj_forward(m, data)
    M = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, data, M)
    return {
        "mass_matrix": T.T @ M @ T,
        "bias_force": T.T @ data.qfrc_bias,
        "forward_dynamics": T.T @ data.qacc,
        "energy": np.array([data.energy[1], data.energy[0]]),
    }


# -- Pinocchio ---------------------------------------------------------------------------------


def from_pinocchio(path: Path, rng, free: bool) -> Case:
    root = [pin.JointModelFreeFlyer()] if free else []
    m = pin.buildModelFromUrdf(str(path), *root)
    m.armature = np.zeros(m.nv)
    bodies = []
    for j in range(1, m.njoints):
        place, inertia = m.jointPlacements[j], m.inertias[j]
        motion = motion_of(m.joints[j])
        bodies.append(
            body(
                m.names[j],
                m.names[m.parents[j]] if m.parents[j] else "ground",
                [motion],
                turn=place.rotation,
                shift=place.translation,
                mass=inertia.mass,
                com=inertia.lever,
                inertia=inertia.inertia,
                armature=[0.0],
            )
        )
    gravity = tuple(m.gravity.linear)
    model = pg.Model(name=path.stem, bodies=tuple(bodies), gravity=gravity)
    assert pg.Topology.of(model).names == tuple(m.names)[1:]
    q, v, tau = random_numbers(rng, model)
    return Case(model, {"q": q, "v": v, "tau": tau, **by_pinocchio(m, q, v, tau, free)})


def motion_of(joint) -> tuple[str, np.ndarray]:
    """Kind and axis; free joints stand at the world's origin."""
    name = joint.shortname()
    if name == "JointModelFreeFlyer":
        return "free", np.array([0.0, 0.0, 1.0])
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0][: joint.nq]))
    S = np.array(data.S).reshape(6)
    return ("translate", S[:3]) if np.any(S[:3]) else ("rotate", S[3:])


def by_pinocchio(m, q, v, tau, free: bool) -> dict[str, np.ndarray]:
    data, T, Tdot_v = m.createData(), np.eye(m.nv), np.zeros(m.nv)
    theirs, i = [], 0
    for joint in list(m.joints)[1:]:
        if joint.nq == 7:
            x, y, z, w, *axis = q[:7]
            theirs += [x, y, z, *axis, w]
            R = matrix(q[3:7])
            T[:6, :6] = np.block([[np.zeros((3, 3)), R.T], [R.T, np.zeros((3, 3))]])
            Tdot_v[:3] = -np.cross(R.T @ v[:3], R.T @ v[3:6])
            i += 7
        else:  # a continuous hinge has cos and sin
            theirs += [q[i]] if joint.nq == 1 else [np.cos(q[i]), np.sin(q[i])]
            i += 1
    x, u = np.array(theirs), T @ v
    M = pin.crba(m, data, x)
    M = np.triu(M) + np.triu(M, 1).T
    a = pin.aba(m, data, x, u, T @ tau)  # T is orthogonal
    kinetic = pin.computeKineticEnergy(m, data, x, u)
    potential = pin.computePotentialEnergy(m, data, x)
    return {
        "mass_matrix": T.T @ M @ T,
        "bias_force": T.T @ pin.rnea(m, data, x, u, Tdot_v),
        "forward_dynamics": T.T @ (a - Tdot_v),
        "energy": np.array([kinetic, potential]),
    }


def main(place: Path) -> None:
    """Read, evaluate, write."""
    rng, arrays, models = np.random.default_rng(0), {}, []
    packages = {d.metadata["Name"]: d.version for d in distributions(path=[str(place)])}
    for name, source in SOURCES.items():
        path = place / source.file
        mjcf = path.suffix == ".xml"
        case = from_mujoco(path, rng) if mjcf else from_pinocchio(path, rng, source.free)
        package = "gymnasium" if mjcf else "example-robot-data"
        head = {"name": name, "package": f"{package} {packages[package]}", **source._asdict()}
        head |= {"read_with": "mujoco" if mjcf else "pinocchio"}
        models.append({**head, "model": json.loads(case.model.to_json())})
        arrays |= {f"{name}/{key}": value for key, value in case.numbers.items()}
    made = {name: version(name) for name in ("mujoco", "pin")}
    text = ",\n".join(json.dumps(model) for model in models)
    (HERE / "third_party.json").write_text(
        f'{{"made_with": {json.dumps(made)}, "models": [\n{text}\n]}}\n', encoding="utf-8"
    )
    np.savez_compressed(HERE / "third_party.npz", allow_pickle=False, **arrays)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""MJCF files of gymnasium, dm_control, gymnasium_robotics and robosuite, compared with MuJoCo."""

import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.dynamics.scene import NO_CONSTRAINTS, Scene
from pgraph_core.engine import motion
from pgraph_core.rotation import matrix, multiply, unit
from tests.models_of_others import files, folder, largest_error

mujoco = pytest.importorskip("mujoco")
PACKAGES = ("gymnasium", "dm-control", "gymnasium-robotics", "robosuite")
SAME = 1e-9  # relative
NOT_SMOOTH = ("ellipsoid", "plane", "heightfield")  # contacts only


def loaded_by_mujoco(path: Path):
    if "<mujoco" not in path.read_text(errors="replace"):
        return None
    try:
        m = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return None
    return m if m.nbody > 1 else None


def start_of(mech: pg.Mechanism, m, rng, given=None):
    """(q, v, qpos, qvel, T) a state in both programs' coordinates: qvel = T v, by place."""
    qpos, T = (m.qpos0 if given is None else given).copy(), np.zeros((m.nv, mech.nv))
    q, v = mech.home()[0], rng.normal(0, 1, mech.nv)
    names = [mech.model.bodies[k].name for k in range(len(mech.model.bodies))]
    pieces = iter([n for n in names if mech.model.body(n).dof])
    name, used, used_q = "", 0, 0
    for j in range(m.njnt):
        at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
        if not name or used == mech.model.body(name).dof:
            name, used, used_q = next(pieces), 0, 0
        joint, kind = mech.joints[name], int(m.jnt_type[j])
        iq, iv = joint.q.start + used_q, joint.v.start + used
        turn = rng.normal(size=4)
        turn /= np.linalg.norm(turn)
        if kind == 0:
            if given is None:
                qpos[at : at + 7] = [*rng.normal(size=3), *turn]
            q[iq : iq + 7], turn = qpos[at : at + 7], qpos[at + 3 : at + 7]
            T[dof : dof + 3, iv + 3 : iv + 6] = np.eye(3)
            T[dof + 3 : dof + 6, iv : iv + 3] = matrix(turn).T
            used, used_q = used + 6, used_q + 7
        elif kind == 1:
            w, x, y, z = home = unit(mech.model.body(name).rotation)
            turn = qpos[at : at + 4] = turn if given is None else qpos[at : at + 4].copy()
            q[iq : iq + 4] = multiply(home, multiply(turn, (w, -x, -y, -z)))
            T[dof : dof + 3, iv : iv + 3] = (matrix(home) @ matrix(turn)).T
            used, used_q = used + 3, used_q + 4
        else:
            qpos[at] += rng.uniform(-1, 1) if given is None else 0.0
            q[iq] = qpos[at] - m.qpos0[at]
            T[dof, iv] = 1.0
            used, used_q = used + 1, used_q + 1
    return q, v, qpos, T @ v, T


def errors_of(model: pg.Model, m, rng, ctrl=0.0) -> dict[str, float]:
    """Largest relative errors of M, bias and, with all that acts, smooth acceleration."""
    still = {b.name: {"friction": (0.0,)} for b in model.bodies if any(b.friction)}
    model = model.edit_all(still) if still else model
    for f in model.forces:
        if isinstance(f, pg.Tendon) and f.friction:
            model = model.edit(f.name, kind="force", friction=0.0)
    mech = pg.Mechanism(model)
    q, v, qpos, qvel, T = start_of(mech, m, rng)
    data = mujoco.MjData(m)
    data.qpos[:], data.qvel[:], data.ctrl[:] = qpos, qvel, ctrl
    mujoco.mj_forward(m, data)
    M = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, data, M)
    bias, size = T.T @ data.qfrc_bias, np.abs(M).max(initial=0.0)
    errors = {
        "M": largest_error(mech.mass_matrix(q), T.T @ M @ T),
        "bias": largest_error(mech.bias_force(q, v), bias, size),
    }
    forces, packed = mech.model.forces, mech.packed
    scene = Scene(packed, packed.drives(forces), packed.loads(forces), NO_CONSTRAINTS)
    tau, vdot, flow = np.zeros(mech.nv), np.zeros(mech.nv), np.zeros(3)
    motion.acceleration(scene.address, 0.0, q, v, tau, vdot, flow)
    if m.nv and np.linalg.cond(M) < 1e10:
        errors["vdot"] = largest_error(vdot, T.T @ data.qacc_smooth)
    return errors


def quietly(reader, *given, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return reader(*given, **options)


def models_of(package) -> Iterator[tuple]:
    """(path, MuJoCo's model, ours, report) of every file that MuJoCo takes."""
    if folder(package) is None:
        pytest.skip(f"{package} cannot be downloaded here")
    for path in files(package, ".xml"):
        if (m := loaded_by_mujoco(path)) is not None:
            yield path, m, *quietly(pg.read_mjcf, path, roots=[folder(package)])


@pytest.mark.nightly
@pytest.mark.parametrize("package", PACKAGES)
def test_models_are_equal_to_mujoco_and_the_same_out_and_in_again(package, tmp_path):
    rng, compared = np.random.default_rng(0), 0
    for k, (path, m, model, report) in enumerate(models_of(package)):
        acting = [e for e in report.of("left out") if e.acts]
        assert all(path.name in e.where or "line" in e.where for e in acting)
        if all(any(word in e.text for word in NOT_SMOOTH) for e in acting):
            errors = errors_of(model, m, rng)
            assert max(errors.values()) < SAME, (path.name, errors)
            compared += 1
        (place := tmp_path / str(k)).mkdir()
        written = quietly(pg.write_mjcf, model, place / "out.xml")
        again, _ = quietly(pg.read_mjcf, place / "out.xml")
        lost = [e for e in written.of("left out") if e.acts]
        assert all("heightfield" in e.text for e in lost), (path.name, lost)
        assert lost or not differences(model, again), (path.name, differences(model, again)[:5])
        if report.loaded:
            theirs = mujoco.MjModel.from_xml_path(str(place / "out.xml"))
            for compiled in (m, theirs):
                errors = errors_of(again, compiled, np.random.default_rng(0))
                assert max(errors.values()) < SAME, (path.name, errors)
    assert compared


def said_of(model: pg.Model) -> dict[tuple[str, ...], object]:
    found = {}
    for key in ("bodies", "constraints", "contacts", "forces", "scenarios", "sites", "outputs"):
        for part in getattr(model, key):
            fields = part.model_dump(exclude={"shapes", "shape", "any_inertia"})
            if isinstance(part, pg.Drag):
                axes = np.array(matrix(unit(fields.pop("rotation"))))
                fields["size"] = axes @ np.diag(np.square(fields["size"])) @ axes.T
            found |= {(key, part.name, field): value for field, value in fields.items()}
    return found


def differences(one: pg.Model, two: pg.Model) -> list[tuple[str, ...]]:
    mine, other = said_of(one), said_of(two)

    def same(x: object, y: object) -> bool:
        if isinstance(x, Mapping) and isinstance(y, Mapping):
            return x.keys() == y.keys() and all(same(x[key], y[key]) for key in x)
        try:
            return np.allclose(np.array(x, float), np.array(y, float), 1e-9, 1e-9, equal_nan=True)
        except (TypeError, ValueError):  # no numbers, or of other shapes
            return x == y

    return [at for at in mine.keys() | other if not same(mine.get(at), other.get(at))]

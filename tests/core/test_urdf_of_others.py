"""URDF files of example-robot-data and robosuite, compared with Pinocchio."""

from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_core.markup import read_markup
from tests.models_of_others import files, folder, largest_error

pin = pytest.importorskip("pinocchio")
PACKAGES = ("example-robot-data", "robosuite", "pybullet")
SAME = 1e-9  # relative


def by_pinocchio(path: Path, mech: pg.Mechanism, rng) -> dict[str, float]:
    m = pin.buildModelFromUrdf(str(path))
    m.armature = np.zeros(m.nv)
    child = {j.get("name"): j.first("child").get("link") for j in read_markup(path).all("joint")}
    q, v, tau = np.zeros(mech.nq), rng.normal(0, 1, mech.nv), rng.normal(0, 5, mech.nv)
    theirs_q, order = np.zeros(m.nq), np.zeros(m.nv, int)
    for joint, name in zip(list(m.joints)[1:], list(m.names)[1:]):
        ours = mech.joints[child[name]]
        assert joint.nv == 1, joint.shortname()
        x = rng.uniform(-1, 1)
        q[ours.q] = x
        angle = joint.nq == 2
        theirs_q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(x), np.sin(x)) if angle else x
        order[joint.idx_v] = ours.v.start
    data = m.createData()
    M = pin.crba(m, data, theirs_q)
    M = np.triu(M) + np.triu(M, 1).T
    errors = {
        "M": largest_error(mech.mass_matrix(q)[np.ix_(order, order)], M),
        "bias": largest_error(
            mech.bias_force(q, v)[order],
            pin.nonLinearEffects(m, data, theirs_q, v[order]),
            np.abs(M).max(initial=0.0),
        ),
    }
    if m.nv and np.linalg.cond(M) < 1e10:
        vdot = pin.aba(m, data, theirs_q, v[order], tau[order])
        errors["vdot"] = largest_error(mech.forward_dynamics(q, v, tau)[order], vdot)
    return errors


def without_friction(model: pg.Model) -> pg.Model:
    bodies = {b.name: {"damping": (0.0,), "friction": (0.0,)} for b in model.bodies if b.dof}
    return model.edit_all(bodies) if bodies else model


@pytest.mark.parametrize("name", ["chain_10", "double_pendulum", "fig1_tree"])
def test_models_of_ours_are_the_same_in_pinocchio(tmp_path, name):
    model = without_friction(pg.Model.load(pgraph_models.path(name)))
    model = model.replace(up="z", gravity=(0.0, 0.0, -9.81))
    pg.write_urdf(model, tmp_path / "ours.urdf")
    errors = by_pinocchio(tmp_path / "ours.urdf", pg.Mechanism(model), np.random.default_rng(0))
    assert max(errors.values()) < 1e-11


@pytest.mark.nightly
@pytest.mark.parametrize("package", PACKAGES)
def test_robots_are_loaded_and_equal_pinocchio(package):
    rng, refused, left_out, count = np.random.default_rng(0), [], [], 0
    for path in files(package, ".urdf"):
        try:
            pin.buildModelFromUrdf(str(path))
        except ValueError:
            continue
        count += 1
        try:
            model, report = pg.read_urdf(path, roots=[folder(package)])
        except pg.PgraphError as error:
            refused.append(str(error))
            continue
        if any(e.acts and "does not exist" not in e.text for e in report.of("left out")):
            left_out.append(path.name)
        errors = by_pinocchio(path, pg.Mechanism(without_friction(model)), rng)
        assert max(errors.values(), default=0.0) < SAME, (path.name, errors)
    if not count:
        pytest.skip(f"{package} cannot be downloaded here")
    assert all(".urdf" in text for text in refused)
    assert len(refused) + len(left_out) <= 0.03 * count, (refused, left_out)

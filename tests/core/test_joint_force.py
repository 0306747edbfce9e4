"""Joint forces have no component along the free motions of their joints."""

import numpy as np
import pytest

import pgraph_core as pg

from .trees import random_model

pytestmark = pytest.mark.quick

KINDS = ("revolute", "prismatic", "universal", "planar", "spherical", "free")
WRENCH = {"force": (3, 40, -5), "torque": (1, 2, 3), "point": (0.4, 0.1, 0)}
PUSH = pg.Wrench(name="push", body="b3", **WRENCH)
BALL = {"kind": "sphere", "radius": 0.3, "position": (0.1, -0.2, 0.15)}


def assert_free(run):
    """Hᵀ F of every joint, the torque of its drive, is zero at every frame."""
    mech, size = run.mechanism, abs(run.joint_force).max()
    for q, force in zip(run.q, run.joint_force):
        for i, (name, parent) in enumerate(zip(mech.names, mech.topology.parent)):
            H = mech.jacobian(q, name, point=(0, 0, 0))
            if parent:
                place, turn = mech.pose(q, mech.names[parent - 1])
                arm = turn.T @ (mech.pose(q, name)[0] - place)
                H = H - mech.jacobian(q, mech.names[parent - 1], point=arm)
            np.testing.assert_allclose(H.T @ force[i], 0.0, atol=1e-10 * size)


def moving(seed, **fields):
    rng = np.random.default_rng(seed)
    model = random_model(rng, 5, KINDS, roots=2, armature=False)
    mech = pg.Mechanism(model.edit("b3", shape=BALL).replace(**fields))
    return mech, mech.home()[0], rng.normal(size=mech.nv)


@pytest.mark.parametrize("point", [None, (0.2, 0.1, -0.1)], ids=["middle of the shape", "given"])
@pytest.mark.parametrize("axis", [None, (0, 0, 1)], ids=["ball", "disc"])
def test_rolling_forces_act_at_the_contact(axis, point):
    rolling = pg.Rolling(name="r", body="b3", point=point, axis=axis, radius=0.3)
    mech, q, v = moving(6, constraints=(rolling,))
    run = pg.simulate(mech, q, v, t_end=0.02, step=1e-3, frames=3, estimate=False)
    assert run.status.ok
    assert abs(run.constraint_force["r"]).max() > 0.1
    assert_free(run)


def test_forces_given_to_runs_are_in_files_and_joined_runs(tmp_path):
    mech, q, v = moving(3)
    run = pg.simulate(mech, q, v, t_end=0.02, step=1e-3, forces=(PUSH,))
    assert_free(run)
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.joint_force, run.joint_force)
    then = pg.simulate(mech, run.q[-1], run.v[-1], t_start=0.02, t_end=0.04, step=1e-3)
    assert_free(pg.joined([run, then]))

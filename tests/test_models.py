"""The built-in models: what they are, that their files are as built, and that they run well."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_models import build
from pgraph_models.quadruped import FEET, holding_torques, origins

pytestmark = pytest.mark.quick

GRAVITY = 9.81
NAMES = [*pgraph_models.names()]


@cache
def model(name: str) -> pg.Model:
    return pg.Model.load(pgraph_models.path(name))


@cache
def run(name: str, scenario: str) -> pg.Result:
    return pg.simulate(pg.Mechanism(model(name)), scenario=scenario)


def test_building_again_gives_the_same_files(tmp_path: Path):
    assert sorted(build.BUILDERS) == NAMES
    build.write(tmp_path)
    for name in NAMES:
        again = (tmp_path / f"{name}.json").read_bytes()
        assert again == pgraph_models.path(name).read_bytes(), name


@pytest.mark.parametrize("name", NAMES)
def test_every_body_has_a_shape_and_every_model_a_scenario(name: str):
    assert all(body.shape is not None for body in model(name).bodies)
    assert all(s.description and s.t_end > 0 for s in model(name).scenarios)
    assert model(name).scenarios


def test_quadruped_totals():
    quadruped = model("quadruped")
    assert len(quadruped.bodies) == 16
    assert sum(b.dof for b in quadruped.bodies) == 21
    assert math.fsum(b.mass for b in quadruped.bodies) == pytest.approx(33.0, abs=1e-12)
    assert quadruped.up == "y"
    assert quadruped.gravity == (0.0, -GRAVITY, 0.0)
    assert all(b.axes == ((0.0, 0.0, 1.0),) for b in quadruped.bodies if b.name != "pelvis")


def test_all_four_feet_stand_on_the_ground():
    at = origins(model("quadruped").bodies)
    heights = [at[c.body][1] + np.asarray(c.point)[1] for c in model("quadruped").constraints]
    assert [c.name for c in model("quadruped").constraints] == list(FEET)
    assert heights == pytest.approx([0.0] * 4, abs=1e-12)


def vertical(result: pg.Result) -> np.ndarray:
    """(len(t), 4) vertical forces on the feet [N]."""
    return np.stack([result.constraint_force[foot][:, 4] for foot in FEET], axis=1)


def test_standing_still_carries_the_weight():
    stand = run("quadruped", "stand")
    assert stand.status.ok
    loads = vertical(stand)
    assert loads[0] == pytest.approx([77.47, 77.47, 84.39, 84.39], abs=0.01)
    assert loads.sum(axis=1) == pytest.approx(33.0 * GRAVITY, abs=1e-4)
    assert np.abs(stand.v).max() < 1e-5  # the torques are rounded to 1e-6 N m


def test_the_push_is_a_good_stance():
    stance = run("quadruped", "stance")
    assert stance.status.ok
    assert stance.t[-1] == pytest.approx(0.25)
    loads = vertical(stance)
    forces = np.stack([stance.constraint_force[foot][:, 3:] for foot in FEET], axis=1)
    friction = np.hypot(forces[..., 0], forces[..., 2]) / loads
    assert loads.min() > 40  # measured 40.8 N
    assert friction.max() < 0.7  # measured 0.44
    drift = stance.constraint_drift.max(axis=0)
    assert drift[0] < 1e-6
    assert drift[1] < 1e-9
    assert np.ptp(stance.q[:, 0]) > 0.03  # the pelvis moves forward [m]


@pytest.mark.parametrize("name", ["pendulum", "double_pendulum", "fig1_tree", "chain_10"])
def test_swings_keep_their_energy_and_move(name: str):
    swing = run(name, "swing")
    assert swing.status.ok
    assert swing.energy_drift < 1e-4  # no dampers; RK4 at 1 ms on fast whips
    assert np.ptp(swing.q, axis=0).min() > 0.2


MUSCLES = "quadruped_muscles"


def test_a_quadruped_has_six_muscles_in_each_leg_and_two_across_each_joint():
    mech = pg.Mechanism(model(MUSCLES))
    names = [f.name for f in model(MUSCLES).forces if isinstance(f, pg.Muscle)]
    assert len(names) == 24 == len({name.replace("left", "right") for name in names}) * 2
    arms = mech.moment_arms(mech.home()[0])
    legs = [b.name for b in mech.model.bodies if "left" in b.name or "right" in b.name]
    for leg in legs:
        across = arms[:, mech.joints[leg].v][:, 0]
        assert across.min() < -0.02, leg  # m
        assert across.max() > 0.02, leg


def test_the_standing_excitations_are_those_of_static_optimisation():
    muscled = model(MUSCLES)
    muscles = [f for f in muscled.forces if isinstance(f, pg.Muscle)]
    found = {f.name: float(str(f.excitation)[1:7]) for f in muscles}
    mech = pg.Mechanism(muscled.replace(forces=muscles))
    torque = holding_torques(muscled.bodies)
    wanted = {name: x for name, x in torque.items() if "left" in name or "right" in name}
    free = mech.activations(wanted)
    assert not free.notices
    # with its tone the animal spends more, and exerts the same
    assert sum(a * a for a in found.values()) > sum(a * a for a in free.activation.values())
    arms = mech.moment_arms(mech.home()[0])
    still = pg.simulate(still_of(muscled), t_end=0.01, scenario="step", estimate=False)
    pulls = np.array([still.tension[name][0] for name in mech.path_names])
    for name, want in wanted.items():
        got = float(arms[:, mech.joints[name].v][:, 0] @ pulls)
        assert got == pytest.approx(want, abs=0.05), name  # excitations have four digits


def still_of(muscled: pg.Model) -> pg.Model:
    """The quadruped with muscles that only stands."""
    return muscled.replace(parameters={"lift": 0.0})


def test_a_quadruped_stands_by_constant_excitations():
    still = pg.simulate(still_of(model(MUSCLES)), t_end=10.0, scenario="step", estimate=False)
    assert still.status.ok
    assert np.abs(still.q[:, :3]).max() < 1e-4  # m; measured 7e-6
    assert np.abs(still.v[-1]).max() < 1e-6  # measured 2e-8: it comes to rest


def test_a_quadruped_trots_by_excitations_over_time():
    trot = pg.simulate(model(MUSCLES), scenario="step", estimate=False)
    assert trot.status.ok
    assert trot.q[:, 3].min() > 0.99  # upright; measured 0.9996
    ups = [foot.replace("paw", "foot") for foot in FEET]
    loaded = np.stack([np.linalg.norm(trot.contacts.force[up], axis=-1) > 0 for up in ups])
    lifted = loaded[:, :-1] & ~loaded[:, 1:]
    assert (lifted.sum(axis=1) >= 3).all()

"""The builders of other engines: they compute what Pgraph computes, on models and motions."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
import pgraph_peers

from .core.trees import random_case, scaled_error

ENGINES = {"mujoco": 1e-8, "pinocchio": 1e-9}  # relative; MuJoCo's small bodies cost digits


def builder(name: str):
    pytest.importorskip(name)
    return import_module(f"pgraph_peers.{name}")


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_and_a_mechanism_agree(name: str, seed: int):
    state = random_case(seed)
    expected = builder(name).evaluate(state)
    mech = pg.Mechanism(state.model)
    found = {
        "mass_matrix": mech.mass_matrix(state.q),
        "bias_force": mech.bias_force(state.q, state.v),
        "forward_dynamics": mech.forward_dynamics(state.q, state.v, state.tau),
    }
    bound = ENGINES[name] * max(1.0, np.linalg.cond(found["mass_matrix"]) / 1e4)
    for quantity, value in found.items():
        assert scaled_error(value, expected[quantity]) < bound, quantity


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_makes_the_motion_of_a_tree_without_actuators(name: str):
    pytest.importorskip(name)
    model = pg.Model.load(pgraph_models.path("double_pendulum"))
    options = {"t_end": 0.2, "steps": 1e-3, "tolerances": 1e-8, "rounds": 1, "frames": 5}
    found = pg.work_precision(model, methods="dop853", peers=name, **options)
    theirs = [row for row in found.rows if row.peer]
    assert theirs
    assert all(row.ok and row.error < 1e-6 for row in theirs), theirs


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_makes_the_motion_of_actuators_and_pinned_points(name: str):
    pytest.importorskip(name)
    model = pg.Model.load(pgraph_models.path("quadruped"))
    options = {"t_end": 0.02, "steps": 5e-4, "tolerances": 1e-8, "rounds": 1, "frames": 3}
    found = pg.work_precision(model, scenario="stance", methods="rk4", peers=name, **options)
    theirs = [row for row in found.rows if row.peer]
    assert theirs
    assert all(row.ok and row.error < 1e-5 for row in theirs), theirs


def test_hinges_of_one_joint_share_a_body_of_mujoco():
    mujoco = builder("mujoco")
    model = pg.Model(bodies=(pg.Body(name="a", joint="universal"), pg.Body(name="b", parent="a")))
    rows = import_module("pgraph_peers.rows").rows_of(model)
    compiled = mujoco.spec_builder(rows, model.gravity, 1e-3)().compile()
    assert (compiled.nbody, compiled.njnt) == (1 + 2, 3)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"limits": ((-3.0, 3.0),)}, "it has joint limits (body 'upper')"),
        ({"friction": 0.1}, "it has joint friction (body 'upper')"),
    ],
)
def test_parts_that_no_engine_gets_are_named(change: dict, sentence: str):
    model = pg.Model.load(pgraph_models.path("double_pendulum")).edit("upper", **change)
    mech = pg.Mechanism(model)
    with pytest.raises(Exception, match="it has joint") as refused:
        pgraph_peers.MUJOCO.run(mech, *mech.home(), np.linspace(0, 1, 3), None, None)
    assert str(refused.value) == sentence

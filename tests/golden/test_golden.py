"""Mechanism and operators against MuJoCo's and Pinocchio's numbers, read from files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.paper import Operators

from ..core.trees import KINDS, scaled_error
from . import forests

HERE = Path(__file__).parent
MODELS = json.loads((HERE / "trees.json").read_text(encoding="utf-8"))["models"]
NUMBERS = np.load(HERE / "trees.npz")
TOLERANCE = 1e-10  # relative; MuJoCo's rows between motions carry 1e-13 kg, M's condition is < 1e4


def case(i):
    """Model, q, v and tau of a case."""
    model = pg.Model.from_json(json.dumps(MODELS[i]))
    return model, *(NUMBERS[f"{i}/{name}"] for name in ("q", "v", "tau"))


def assert_golden(i, oracle, values):
    """Every number that the oracle gave is among `values`, and equal."""
    for name, found in values.items():
        expected = NUMBERS[f"{i}/{oracle}/{name}"]
        scale = max(1.0, float(abs(expected).max()))
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * scale, err_msg=name)


@pytest.mark.parametrize("oracle", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("i", range(len(MODELS)))
def test_operators_equal_golden(i, oracle):
    model, q, v, tau = case(i)
    op = Operators(model, pg.Topology.of(model), q, v)
    values = {
        "mass_matrix": op.mass_matrix,
        "bias_force": op.bias_force,
        "forward_dynamics": op.forward_dynamics(tau),
        "tip_jacobian": op.jacobian,
        "position": op.position,
        "rotation": op.rotation,
    }
    assert_golden(i, oracle, values)


@pytest.mark.parametrize("oracle", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("i", range(len(MODELS)))
def test_mechanism_equals_golden(i, oracle):
    model, q, v, tau = case(i)
    mech = pg.Mechanism(model)
    poses = [mech.pose(q, name) for name in mech.names]
    values = {
        "mass_matrix": mech.mass_matrix(q),
        "bias_force": mech.bias_force(q, v),
        "forward_dynamics": mech.forward_dynamics(q, v, tau),
        "tip_jacobian": mech.tip_jacobian(q),
        "position": np.array([position for position, _ in poses]),
        "rotation": np.array([rotation for _, rotation in poses]),
    }
    assert_golden(i, oracle, values)


@pytest.fixture(scope="module")
def many():
    """200 forests with our mechanisms."""
    return [(forest, pg.Mechanism(forest.state.model)) for forest in forests.load()]


def test_200_forests_hold_every_kind_of_joint_in_motion(many):
    kinds = [body.joint for forest, _ in many for body in forest.state.model.bodies]
    assert len(many) == 200
    assert set(kinds) == set(KINDS)
    assert all(forest.state.v.any() for forest, _ in many)


@pytest.mark.parametrize("back_end", ["articulated", "composite", "operators"])
@pytest.mark.parametrize("oracle", forests.ORACLES)
def test_200_forests_equal_golden(many, oracle, back_end):
    for n, (forest, mech) in enumerate(many):
        s, choice = forest.state, {"back_end": back_end}
        values = {
            "mass_matrix": mech.mass_matrix(s.q, **choice),
            "bias_force": mech.bias_force(s.q, s.v, **choice),
            "forward_dynamics": mech.forward_dynamics(s.q, s.v, s.tau, **choice),
            "tip_jacobian": mech.tip_jacobian(s.q),
            "position": mech.poses(s.q)[0],
        }
        for name, found in forests.vectors(s, values).items():
            error = scaled_error(found, forest.by[oracle][name])
            assert error < TOLERANCE, f"forest {n}, {name}"


def test_stance_run_equals_pinocchio_s():
    """Checklist E10: two independent solvers, here to 1e-8 where the paper has 4 %."""
    mech = pg.Mechanism(pg.Model.load(HERE / "stance.json"))
    golden = np.load(HERE / "stance.npz")
    run = pg.simulate(mech, scenario="stance", t_eval=golden["t"])
    np.testing.assert_allclose(run.q, golden["q"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.v, golden["v"], rtol=0, atol=1e-6)
    for i, constraint in enumerate(mech.model.constraints):
        found = run.constraint_force[constraint.name][:, 3:]
        np.testing.assert_allclose(found, golden["force"][:, i], rtol=0, atol=1e-4)

"""Robots of other authors: MuJoCo's and Pinocchio's dynamics, by tests/golden/third_party.py."""

import json
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.paper import Operators

from .trees import scaled_error

pytestmark = pytest.mark.quick

GOLDEN = Path(__file__).parents[1] / "golden"
ENTRIES = json.loads((GOLDEN / "third_party.json").read_text(encoding="utf-8"))["models"]
NUMBERS = np.load(GOLDEN / "third_party.npz")
NAMES = [entry["name"] for entry in ENTRIES]
AGREE = 1e-9  # relative


def case(name):
    entry = ENTRIES[NAMES.index(name)]
    numbers = {k.split("/")[1]: NUMBERS[k] for k in NUMBERS.files if k.split("/")[0] == name}
    state = [numbers.pop(key) for key in ("q", "v", "tau")]
    return pg.Model.from_json(json.dumps(entry["model"])), *state, numbers


@pytest.mark.parametrize("name", NAMES)
def test_mechanism_equals_the_oracle(name):
    model, q, v, tau, expected = case(name)
    mech = pg.Mechanism(model)
    found = {
        "mass_matrix": mech.mass_matrix(q),
        "bias_force": mech.bias_force(q, v),
        "forward_dynamics": mech.forward_dynamics(q, v, tau),
        "energy": np.array(mech.energy(q, v)),
    }
    op = Operators(model, pg.Topology.of(model), q, v)
    found |= {
        "operators": op.mass_matrix,
        "operators' bias": op.bias_force,
        "operators' acceleration": op.forward_dynamics(tau),
    }
    keys = ["mass_matrix", "bias_force", "forward_dynamics", "energy", "mass_matrix", "bias_force",
            "forward_dynamics"]  # fmt: skip
    assert set(keys) == set(expected)
    errors = {name: scaled_error(found[name], expected[key]) for name, key in zip(found, keys)}
    assert max(errors.values()) < AGREE, errors

"""Remake the golden files: `python -m tests.golden.build` with mujoco and pin installed.

Each case is a model with a state; its mass matrix, bias force, forward dynamics, Jacobian and
poses come from MuJoCo and from Pinocchio (`peers/`), in our conventions, never from our own code.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import numpy as np

import pgraph_core as pg
import pgraph_models
from benchmarks.stance_in_pinocchio import stance
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio

from ..core.trees import State, random_case, random_state, scaled_error
from . import forests
from .contacts import contacts

HERE = Path(__file__).parent
TREES = 30  # with every matrix
FORESTS = 200  # with vectors only
AGREEMENT = 1e-10  # of the two oracles with each other
CONDITION = 1e4  # of M, so that forward dynamics can be compared


def cases() -> list[tuple[State, dict[str, dict[str, np.ndarray]]]]:
    """The quadruped and the first TREES seeds whose mass matrix is well conditioned."""
    model = pg.Model.load(pgraph_models.path("quadruped"))
    found = [evaluated(random_state(np.random.default_rng(0), model))]
    seed = 0
    while len(found) < TREES + 1:
        state = random_case(seed)
        seed += 1
        if not len(state.v):
            continue
        case = evaluated(state)
        if np.linalg.cond(case[1]["pinocchio"]["mass_matrix"]) < CONDITION:
            found.append(case)
    return found


def many_forests() -> None:
    """Write forests.npz: the first FORESTS seeds from 1000 on that are well conditioned."""
    items = []
    seed = 1000
    while len(items) < FORESTS:
        fields, thousandths = forests.rounded(seed)
        state = forests.state_of(fields, thousandths)
        seed += 1
        if not len(state.v):
            continue
        _, by = evaluated(state)
        if np.linalg.cond(by["pinocchio"]["mass_matrix"]) < CONDITION:
            check_agreement(by)
            kept = {oracle: forests.vectors(state, values) for oracle, values in by.items()}
            items.append((fields, thousandths, kept))
    forests.save(items)


def evaluated(state: State) -> tuple[State, dict[str, dict[str, np.ndarray]]]:
    """A state and the results of both oracles."""
    by = {"mujoco": in_mujoco.evaluate(state), "pinocchio": in_pinocchio.evaluate(state)}
    return state, by


def check_agreement(by: dict[str, dict[str, np.ndarray]]) -> None:
    """The two oracles agree, or a mapping of conventions is wrong."""
    for name, expected in by["pinocchio"].items():
        error = scaled_error(by["mujoco"][name], expected)
        if error > AGREEMENT:
            raise SystemExit(f"MuJoCo and Pinocchio differ in {name} by {error:.2e}")


def main() -> None:
    """Write trees.json (models), trees.npz (states and numbers), forests.npz and the stance."""
    arrays: dict[str, np.ndarray] = {}
    models = []
    for i, (state, by) in enumerate(cases()):
        check_agreement(by)
        models.append(json.loads(state.model.replace(scenarios=(), forces=()).to_json()))
        arrays |= {f"{i}/{name}": getattr(state, name) for name in ("q", "v", "tau")}
        for oracle, values in by.items():
            arrays |= {f"{i}/{oracle}/{name}": value for name, value in values.items()}
    made = {name: version(name) for name in ("mujoco", "pin")}
    text = ",\n".join(json.dumps(model) for model in models)
    (HERE / "trees.json").write_text(
        f'{{"made_with": {json.dumps(made)}, "models": [\n{text}\n]}}\n', encoding="utf-8"
    )
    np.savez_compressed(HERE / "trees.npz", allow_pickle=False, **arrays)
    many_forests()
    model = pg.Model.load(pgraph_models.path("quadruped"))
    (HERE / "stance.json").write_text(model.to_json(), encoding="utf-8")
    np.savez_compressed(HERE / "stance.npz", allow_pickle=False, **stance(model))
    np.savez_compressed(HERE / "contacts.npz", allow_pickle=False, **contacts())


if __name__ == "__main__":
    main()

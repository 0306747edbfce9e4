"""The builders of other engines: they compute what Pgraph computes, on models and motions."""

from importlib import import_module

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
import pgraph_peers
from pgraph_core.study.task import installed_peers

from .core.trees import State, random_case, scaled_error
from .nights import combined

ENGINES = {"mujoco": 1e-8, "pinocchio": 1e-9}  # relative; MuJoCo's small bodies cost digits


def builder(name: str):
    pytest.importorskip(name)
    return import_module(f"pgraph_peers.{name}")


@pytest.mark.parametrize("seed", range(4))
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


MOTIONS = {  # scenario, duration and step [s], largest error
    "double_pendulum": (None, 0.2, 1e-3, 1e-6),
    "fig1_tree": (None, 0.1, 1e-3, 1e-6),  # numbered otherwise than depth-first
    "quadruped": ("stance", 0.02, 5e-4, 1e-5),  # actuators and pinned points
    "four_bar": ("turn", 0.3, 1e-3, 1e-6),  # closed between two of its bodies
}


@pytest.mark.parametrize(("name", "model"), combined(ENGINES, MOTIONS))
def test_an_engine_makes_the_motion(name: str, model: str):
    pytest.importorskip(name)
    scenario, t_end, step, bound = MOTIONS[model]
    options = {"t_end": t_end, "steps": step, "tolerances": 1e-9, "rounds": 1, "frames": 4}
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(model)))
    found = pg.work_precision(mech, scenario=scenario, methods="rk4", peers=name, **options)
    theirs = [row for row in found.rows if row.peer]
    assert theirs, found.notes
    assert all(row.ok and (row.error or 1.0) < bound for row in theirs), theirs


@pytest.mark.parametrize(("name", "bound"), [("mujoco", 3.0), ("pinocchio", 1e-2)])
def test_forces_of_a_stance(name: str, bound: float):
    """Forces on the quadruped's feet at rest equal ours [N], but MuJoCo's feet are soft."""
    engine, model = builder(name), pg.Model.load(pgraph_models.path("quadruped"))
    mech = pg.Mechanism(model)
    q, v = mech.home()
    state = State(model, mech.topology, q, v, 0 * v, 0 * v, np.zeros((mech.nb, 6)))
    _, found = mech.constrained_dynamics(q, v, state.tau)
    vertical = np.array([found[c.name][4] for c in model.constraints])
    if name == "mujoco":
        compiled, data = engine.stance(state)
        import_module("mujoco").mj_forward(compiled, data)
        theirs = np.array(data.efc_force).reshape(-1, 3)[:, 1]
    else:
        call, forces = engine.stance(state)
        call()
        theirs = forces()[:, 1]
    assert abs(theirs - vertical).max() < bound, (theirs, vertical)


@pytest.mark.parametrize("change", [{"limits": ((-3.0, 3.0),)}, {"friction": 0.1}])
def test_parts_that_no_engine_gets_are_named(change: dict):
    model = pg.Model.load(pgraph_models.path("double_pendulum")).edit("upper", **change)
    mech = pg.Mechanism(model)
    with pytest.raises(Exception, match=f"{next(iter(change))}.*body 'upper'"):
        pgraph_peers.MUJOCO.run(mech, *mech.home(), np.linspace(0, 1, 3), None, None)


@pytest.mark.parametrize(
    ("model", "name"),
    combined(["double_pendulum", "heavy_top", "four_bar", "stiff_pendulum"], ["sundials", "scipy"]),
)
def test_an_integrator_of_our_equations_finds_the_motion(name: str, model: str):
    """Hinges, a ball, a loop and a stiff spring, by each of its methods."""
    pytest.importorskip("sksundae")
    if name not in installed_peers():
        pytest.skip("installed before this peer was there")
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(model)))
    turning = "turn" if model == "four_bar" else None  # it rests otherwise
    options = {"t_end": 0.1, "tolerances": 1e-7, "rounds": 1, "frames": 5, "scenario": turning}
    found = pg.work_precision(mech, methods="radau5", peers=name, longest=120.0, **options)
    theirs = [row for row in found.rows if row.peer]
    assert len(theirs) == {"sundials": 3, "scipy": 2}[name], found.notes
    assert all(row.ok and row.error < 3e-5 for row in theirs), theirs

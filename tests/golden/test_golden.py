"""Mechanism and operators against the numbers of MuJoCo and Pinocchio, read from files."""

import json
from pathlib import Path

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.paper import Operators, bodies_of

from ..core.trees import KINDS, scaled_error
from ..nights import at_night

HERE = Path(__file__).parent
MODELS = json.loads((HERE / "trees.json").read_text(encoding="utf-8"))["models"]
NUMBERS = np.load(HERE / "trees.npz")
ORACLES = ("pinocchio", "mujoco")
TOLERANCE = 1e-10  # relative; MuJoCo's rows between motions carry 1e-13 kg, M's condition is < 1e4


def depth_first(fields):
    """The model with the rows of its table in the depth-first order of the numbers in the files."""
    children = {}
    for body in fields["bodies"]:
        children.setdefault(body.get("parent", "ground"), []).append(body)
    bodies, left = [], children["ground"][::-1]
    while left:
        bodies.append(left.pop())
        left.extend(reversed(children.get(bodies[-1]["name"], [])))
    return pg.Model.from_json(json.dumps({**fields, "bodies": bodies}))


@pytest.mark.filterwarnings("ignore:forward_dynamics")
@pytest.mark.parametrize("oracle", ORACLES)
@pytest.mark.parametrize("i", range(len(MODELS)))
def test_operators_and_mechanism_equal_golden(i, oracle):
    model = depth_first(MODELS[i])
    q, v, tau = (NUMBERS[f"{i}/{name}"] for name in ("q", "v", "tau"))
    op, mech = Operators(model, pg.Topology.of(model), q, v), pg.Mechanism(model)
    position, rotation = mech.poses(q)
    values = {
        "mass_matrix": (op.mass_matrix, mech.mass_matrix(q)),
        "bias_force": (op.bias_force, mech.bias_force(q, v)),
        "forward_dynamics": (op.forward_dynamics(tau), mech.forward_dynamics(q, v, tau)),
        "tip_jacobian": (op.jacobian, mech.tip_jacobian(q)),
        "position": (op.position, position),
        "rotation": (op.rotation, rotation),
    }
    for name, both in values.items():
        expected = NUMBERS[f"{i}/{oracle}/{name}"]
        scale = TOLERANCE * max(1.0, float(abs(expected).max()))
        for found in both:
            np.testing.assert_allclose(found, expected, rtol=0, atol=scale, err_msg=name)


def forests():
    """Models and states of forests.npz in thousandths, and the vectors of both oracles.

    Vectors see every entry of M and J through one random direction. Those of MuJoCo are kept as
    differences from those of Pinocchio.
    """
    arrays = dict(np.load(HERE / "forests.npz"))
    taken = dict.fromkeys(arrays, 0)

    def take(name, n):
        taken[name] += n
        return arrays[name][taken[name] - n : taken[name]]

    for fields in json.loads(arrays["models"].tobytes()):
        model = depth_first(fields)
        topology = pg.Topology.of(model)
        bodies, nv = bodies_of(model, topology), int(topology.dof.sum())
        nq = sum(joints.nq(body.sequence) for body in bodies)
        q, v, tau, vdot = np.split(take("state", nq + 3 * nv) / 1000, nq + np.arange(3) * nv)
        i = 0
        for motion in (m for body in bodies for m in body.sequence):
            i += joints.SIZE[motion.kind][0]
            if motion.kind in ("ball", "free"):
                q[i - 4 : i] /= np.linalg.norm(q[i - 4 : i])
        size = {"bias_force": nv, "inverse_dynamics": nv, "forward_dynamics": nv}
        size |= {"tip_velocity": 6 * len(topology.tips), "position": 3 * topology.nb}
        exact = {name: take(f"pinocchio/{name}", n) for name, n in size.items()}
        other = {name: exact[name] + take(f"mujoco/{name}", n) for name, n in size.items()}
        yield pg.Mechanism(model), q, v, tau, vdot, {"pinocchio": exact, "mujoco": other}


@pytest.fixture(scope="module")
def many():
    return list(forests())


def test_200_forests_hold_every_kind_of_joint_in_motion(many):
    assert len(many) == 200
    assert {body.joint for mech, *_ in many for body in mech.model.bodies} == set(KINDS)
    assert all(v.any() for _, _, v, *_ in many)


@pytest.mark.parametrize(("dense", "each"), [(False, 1), (True, 5), *at_night((True, 1))])
def test_200_forests_equal_golden(many, dense, each):
    """By the kernels, and by the paper's operators."""
    for n, (mech, q, v, tau, vdot, by) in enumerate(many[::each]):
        op = Operators(mech.model, pg.Topology.of(mech.model), q, v)
        bias = op.bias_force if dense else mech.bias_force(q, v)
        mass = op.mass_matrix if dense else mech.mass_matrix(q)
        forward = op.forward_dynamics(tau) if dense else mech.forward_dynamics(q, v, tau)
        found = {
            "bias_force": bias,
            "inverse_dynamics": mass @ vdot + bias,
            "forward_dynamics": forward,
            "tip_velocity": mech.tip_jacobian(q) @ v,
            "position": mech.poses(q)[0].reshape(-1),
        }
        for oracle in ORACLES:
            for name, values in found.items():
                error = scaled_error(values, by[oracle][name])
                assert error < TOLERANCE, f"forest {n}, {name}"


def test_the_stance_equals_that_of_pinocchio():
    """Two independent solvers, here to 1e-8 where the paper has 4 %."""
    mech = pg.Mechanism(pg.Model.load(HERE / "stance.json"))
    golden = np.load(HERE / "stance.npz")
    run = pg.simulate(mech, scenario="stance", t_eval=golden["t"])
    np.testing.assert_allclose(run.q, golden["q"], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.v, golden["v"], rtol=0, atol=1e-6)
    for i, constraint in enumerate(mech.model.constraints):
        found = run.constraint_force[constraint.name][:, 3:]
        np.testing.assert_allclose(found, golden["force"][:, i], rtol=0, atol=1e-4)

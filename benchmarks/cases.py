"""What is compared: the same work by Pgraph, MuJoCo and Pinocchio, checked to agree."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import mujoco
import mujoco.rollout
import numpy as np
import pinocchio as pin

import pgraph_core as pg
import static_models
from tests.core.trees import State, random_state
from tests.golden import with_mujoco, with_pinocchio
from tests.golden.elementary import rows_of

from .timing import Case

STEP = 1e-3
INTEGRATORS = {"semi_implicit_euler": "Euler", "rk4": "RK4"}
ANCHOR = 'solref="0.002 1" solimp="0.99 0.999 0.001"'  # MuJoCo's feet are soft: near its stiffest


def all_cases() -> Iterable[Case]:
    """Every comparison, made one after the other."""
    model = pg.Model.load(static_models.path("quadruped"))
    state = random_state(np.random.default_rng(3), model)
    yield forward_dynamics(state)
    for method in INTEGRATORS:
        yield steps(state, method, "quadruped", 1000)
    tree = random_state(np.random.default_rng(4), binary_tree(1023))
    yield steps(tree, "semi_implicit_euler", "tree of 1023", 50)
    yield stance(model)
    yield stance_run(model)
    yield one_edit(model)
    yield construction(model, "quadruped", pinocchio=True)
    yield construction(binary_tree(1023), "tree of 1023", pinocchio=False)


def differ(found: np.ndarray, expected: np.ndarray, bound: float) -> str:
    """How far two results differ, relative; refuses to time what does not agree."""
    error = float(abs(found - expected).max() / max(1.0, abs(expected).max()))
    if not error < bound:
        raise SystemExit(f"the results differ by {error:.2e}: nothing is timed")
    return f"{error:.1e}"


def forward_dynamics(state: State) -> Case:
    """v' of the tree, one call from Python."""
    mech = pg.Mechanism(state.model)
    q, v, tau = state.q, state.v, state.tau
    expected = with_pinocchio.evaluate(state)["forward_dynamics"]
    agreement = differ(mech.forward_dynamics(q, v, tau), expected, 1e-9)
    rows = rows_of(state.model, state.topology)
    model, _ = with_pinocchio.build(state.model, rows)
    data = model.createData()
    p, T, _ = with_pinocchio.coordinates(rows, model, state)
    speed, load = T @ v, np.linalg.solve(T.T, tau)
    return Case(
        "forward dynamics, quadruped",
        {
            "pgraph": lambda: mech.forward_dynamics(q, v, tau),
            "pin.aba": lambda: pin.aba(model, data, p, speed, load),
        },
        agreement=agreement,
        goal=2,
    )


def steps(state: State, method: str, name: str, number: int) -> Case:
    """Steps of a tree under gravity inside one run, nothing recorded but its end.

    Ours is what `simulate` takes to build and to step; the error estimate that it makes besides
    has no counterpart.
    """
    mech = pg.Mechanism(state.model.replace(scenarios=(), constraints=(), forces=()))
    q, v = state.q, 0.2 * state.v
    rows = rows_of(mech.model, state.topology)
    option = f'timestep="{STEP}" integrator="{INTEGRATORS[method]}"'
    model = mujoco.MjModel.from_xml_string(with_mujoco.mjcf(mech.model, rows, option))
    data = mujoco.MjData(model)
    qpos, T = with_mujoco.coordinates(rows, state)
    start = np.concatenate(([0.0], qpos, T @ v))[None]

    def run(n: int) -> pg.Result:
        return pg.simulate(mech, q, v, t_end=n * STEP, method=method, step=STEP, frames=2)

    def ours() -> float:
        timing = run(number).timing
        return timing["build"] + timing["step"]

    def theirs(n: int = number) -> np.ndarray:
        return mujoco.rollout.rollout(model, data, start, nstep=n)[0]

    end = theirs(50)[0, -1, 1 : 1 + model.nq] - (qpos - q)
    return Case(
        f"{method} step, {name}",
        {"pgraph": ours, "mujoco.rollout": theirs},
        unit="step",
        per_call=number,
        agreement=differ(run(50).q[-1], end, 1e-5),
        goal=2,
        clocked=frozenset({"pgraph"}),
    )


def stance(model: pg.Model) -> Case:
    """Constrained dynamics of the quadruped on four feet, one call from Python."""
    mech = pg.Mechanism(model)
    q, v = mech.home()
    state = State(model, mech.topology, q, v, holding_torques(model), v, np.zeros((16, 6)))
    ours = mech.constrained_dynamics(q, v, state.tau)
    pinocchio, force = stance_pinocchio(state)
    forward, data = stance_mujoco(state)
    pinocchio()
    forward()
    vertical = np.array([ours[1][c.name][4] for c in model.constraints])
    agreement = differ(vertical, np.array([f.linear[1] for f in force()]), 1e-5)
    soft = abs(np.array(data.efc_force).reshape(-1, 3)[:, 1] - vertical).max()
    return Case(
        "constrained dynamics, four feet",
        {
            "pgraph": lambda: mech.constrained_dynamics(q, v, state.tau),
            "pin.constraintDynamics": pinocchio,
            "mj_forward": forward,
        },
        agreement=f"{agreement}; MuJoCo's soft feet by {soft:.2g} N",
        goal=2,
    )


def holding_torques(model: pg.Model) -> np.ndarray:
    """(nv,) of the scenario 'stand'."""
    names = pg.Topology.of(model).names
    tau = np.zeros(sum(body.dof for body in model.bodies))
    for force in model.scenario("stand").forces:
        tau[names.index(force.body) + 5] = force.torque
    return tau


def stance_pinocchio(state: State) -> tuple[Callable[[], object], Callable[[], list]]:
    """(the call, the contact forces in world axes after it) of Pinocchio's proximal solver."""
    rows = rows_of(state.model, state.topology)
    model, _ = with_pinocchio.build(state.model, rows)
    data = model.createData()
    q, T, _ = with_pinocchio.coordinates(rows, model, state)
    held, found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for c in state.model.constraints:
        place = pin.SE3(np.eye(3), np.array(c.point))
        joint, axes = model.getJointId(c.body), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        held.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joint, place, axes))
        found.append(held[-1].createData())
    pin.initConstraintDynamics(model, data, held, found)
    settings = pin.ProximalSettings(1e-10, 1e-6, 10)  # four iterations, to 1e-13 N
    v, tau = T @ state.v, np.linalg.solve(T.T, state.tau)

    def call() -> object:
        return pin.constraintDynamics(model, data, q, v, tau, held, found, settings)

    return call, lambda: [f.contact_force for f in found]


def stance_mujoco(state: State) -> tuple[Callable[[], object], mujoco.MjData]:
    """mj_forward with four `connect` constraints, and its data."""
    rows = rows_of(state.model, state.topology)
    feet = "".join(
        f'<connect body1="{c.body}" body2="world" anchor="{" ".join(map(str, c.point))}" {ANCHOR}/>'
        for c in state.model.constraints
    )
    text = with_mujoco.mjcf(
        state.model, rows, "", 'contact="disable"', f"<equality>{feet}</equality>"
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], T = with_mujoco.coordinates(rows, state)
    data.qfrc_applied[:] = T @ state.tau
    return lambda: mujoco.mj_forward(model, data), data


def stance_run(model: pg.Model) -> Case:
    """The paper's run: 0.25 s of stance at 1 ms, everything recorded."""
    mech = pg.Mechanism(model)
    run = pg.simulate(mech, scenario="stance")
    drift = f"feet drift {run.constraint_drift[:, 0].max():.1e} m"
    name = "stance run, 0.25 s at 1 ms"
    return Case(name, {"pgraph": lambda: pg.simulate(mech, scenario="stance")}, "run", 1, drift)


def one_edit(model: pg.Model) -> Case:
    """One body hung elsewhere: new Pgraph, arrays and mass matrix, from the description on."""
    turns = iter(range(10**9))

    def ours() -> tuple[np.ndarray, ...]:
        parent = ("left_femur", "left_tibia")[next(turns) % 2]
        mech = pg.Mechanism(model.edit("left_hind_paw", parent=parent))
        return mech.pgraph, mech.jdof, mech.mass_matrix(mech.home()[0])

    peers = builders(model, pinocchio=True)
    return Case("one parent changed, quadruped", {"pgraph": ours, **peers}, "edit")


def construction(model: pg.Model, name: str, *, pinocchio: bool) -> Case:
    """From the description to a mechanism that can be asked; peers build theirs anew."""
    return Case(
        f"model to mechanism, {name}",
        {"pgraph": lambda: pg.Mechanism(model), **builders(model, pinocchio=pinocchio)},
        "model",
    )


def builders(model: pg.Model, *, pinocchio: bool) -> dict[str, Callable[[], object]]:
    """MjSpec's compilation with its data, and Pinocchio's model with its data."""
    rows = rows_of(model, pg.Topology.of(model))
    spec = mujoco.MjSpec.from_string(with_mujoco.mjcf(model, rows))
    found: dict[str, Callable[[], object]] = {
        "MjSpec.compile + MjData": lambda: mujoco.MjData(spec.compile())
    }
    if pinocchio:  # its data is cubic in memory: not for long chains
        found["pin.Model + Data"] = lambda: with_pinocchio.build(model, rows)[0].createData()
    return found


def binary_tree(n: int) -> pg.Model:
    """Rods in a tree with two children each."""
    rods = pg.Model.serial(n).bodies
    parents = ["ground", *(str(i // 2) for i in range(2, n + 1))]
    return pg.Model(bodies=tuple(b.model_copy(update={"parent": p}) for b, p in zip(rods, parents)))

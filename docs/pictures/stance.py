"""The paper's case study (sec. 5), by our solver and two others, and its figures.

`python -m docs.pictures.stance` prints how far the solvers differ and writes
docs/pictures/stance_*.svg; `--check` prints alone. Needs mujoco, pin and matplotlib.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
import pgraph_models
from benchmarks.scenes import State
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

SCENARIO = "stance"
PAW = "left_hind_paw"  # body 13: the first branch of each girdle is taken for the left one
PICTURES = Path(__file__).parent
SETTINGS = (1e-13, 1e-9, 50)  # of Pinocchio's solver: accuracy, mu, iterations
FINE = 5  # steps of the peers in one of ours
SETTLE = 500  # steps of MuJoCo's before the first
MIRRORED = (8, 9, 10, 14, 15, 16)  # right legs, which move like the left ones
AXIS = 5  # the root's turn about z in v = [linear, angular] of the peers


class Curves(NamedTuple):
    """The quantities of the paper's figures, at our output times."""

    alpha: np.ndarray  # (len(t), 17) angular accelerations about z of the ground, bodies 1..16
    force: np.ndarray  # (len(t), 4, 3) of the ground on the paws, in the order of constraints [N]


def ours(model: pg.Model) -> tuple[pg.Result, Curves]:
    """The built-in scenario as it is."""
    run = pg.simulate(pg.Mechanism(model), scenario=SCENARIO)
    alpha = np.pad(run.body_acceleration[:, :, 2], ((0, 0), (1, 0)))
    force = np.stack([run.constraint_force[c.name][:, 3:] for c in model.constraints], axis=1)
    return run, Curves(alpha, force)


def summed(topology: pg.Topology, root: np.ndarray, hinges: np.ndarray) -> np.ndarray:
    """(len(t), 17) accelerations of plane motion: those of the joints, added along each path."""
    alpha = np.zeros((len(root), len(topology.parent) + 1))
    alpha[:, 1] = root
    for k, parent in enumerate(topology.parent[1:], 2):
        alpha[:, k] = alpha[:, parent] + hinges[:, k - 2]
    return alpha


def by_pinocchio(model: pg.Model, t: np.ndarray) -> Curves:
    """pin.constraintDynamics in a plain RK4; no position or velocity is projected."""
    acceleration = constrained(model, model.scenario(SCENARIO))
    topology = pg.Topology.of(model)
    q, v = np.concatenate([model.body(name).q for name in topology.names]), np.zeros(21)
    h, found = (t[1] - t[0]) / FINE, []
    for time in t:
        found.append(acceleration(time, q, v))
        for n in range(FINE):
            q, v = rk4(acceleration, time + n * h, h, q, v)
    vdot, force = (np.array(column) for column in zip(*found))
    return Curves(summed(topology, vdot[:, 2], vdot[:, 6:]), force)


def rk4(acceleration: Callable, t: float, h: float, q: np.ndarray, v: np.ndarray) -> tuple:
    """One step of the classical method on q, quaternion included, and v."""

    def rate(s: float, q: np.ndarray, v: np.ndarray) -> tuple:
        return velocity(q, v), acceleration(t + s, q, v)[0]

    k1 = rate(0, q, v)
    k2 = rate(h / 2, q + h / 2 * k1[0], v + h / 2 * k1[1])
    k3 = rate(h / 2, q + h / 2 * k2[0], v + h / 2 * k2[1])
    k4 = rate(h, q + h * k3[0], v + h * k3[1])
    q, v = (x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v), k1, k2, k3, k4))
    q[3:7] /= np.linalg.norm(q[3:7])
    return q, v


def velocity(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """q' of a free root and hinges: ½ [0, ω] times the quaternion."""
    w, x = q[3], q[4:7]
    turn = np.concatenate(([-v[:3] @ x], w * v[:3] + np.cross(v[:3], x))) / 2
    return np.concatenate((v[3:6], turn, v[6:]))


def constrained(model: pg.Model, scenario: pg.Scenario) -> Callable:
    """(t, q, v) -> (v', forces (4, 3)) with the scenario's servos, by pin.constraintDynamics."""
    state = at_home(model)
    rows = rows_of(model, state.topology)
    acceleration, forces = in_pinocchio.constrained(state, SETTINGS)
    servo = [(state.topology.names.index(f.body) + 5, f) for f in scenario.forces]

    def rate(t: float, q: np.ndarray, v: np.ndarray) -> tuple:
        unit = np.concatenate((q[:3], q[3:7] / np.linalg.norm(q[3:7]), q[7:]))
        tau = np.zeros(21)
        for j, f in servo:
            tau[j] = f.kp * (value(f.target, t) - q[j + 1]) - f.kd * v[j] + value(f.torque, t)
        p, T, Tdot_v = in_pinocchio.coordinates(rows, unit, v)
        a = acceleration(p, T @ v, np.linalg.solve(T.T, tau))
        return np.linalg.solve(T, a - Tdot_v), forces()

    return rate


def at_home(model: pg.Model) -> State:
    """The model's own initial state, without torques."""
    topology = pg.Topology.of(model)
    q = np.concatenate([model.body(name).q for name in topology.names])
    v = np.concatenate([model.body(name).v for name in topology.names])
    return State(model, topology, q, v, 0 * v, v, np.zeros((0, 6)))


def value(table: float | pg.Table, t: float) -> float:
    """A constant, or straight lines between knots."""
    return table if isinstance(table, float) else float(np.interp(t, table.t, table.value))


def by_mujoco(model: pg.Model, t: np.ndarray) -> Curves:
    """Four `connect` constraints near the stiffest that MuJoCo takes, its RK4.

    Its feet are springs: before the clock starts they sink in until they carry the weight.
    """
    import mujoco

    topology, scenario = pg.Topology.of(model), model.scenario(SCENARIO)
    servos = [(topology.names.index(f.body) + 5, f) for f in scenario.forces]
    robot, data = in_mujoco.stance(at_home(model), in_mujoco.STIFF, (t[1] - t[0]) / FINE, rk4=True)

    def drive(_: Any, data: Any) -> None:
        for j, f in servos:
            time = data.time - SETTLE * robot.opt.timestep
            gap = value(f.target, time) - data.qpos[j + 1]
            data.qfrc_applied[j] = f.kp * gap - f.kd * data.qvel[j] + value(f.torque, time)

    found = []
    mujoco.set_mjcb_control(drive)
    try:
        mujoco.mj_step(robot, data, SETTLE)
        for _ in t:
            mujoco.mj_forward(robot, data)
            found.append((data.qacc.copy(), data.efc_force.reshape(-1, 3).copy()))
            mujoco.mj_step(robot, data, FINE)
    finally:
        mujoco.set_mjcb_control(None)
    vdot, force = (np.array(column) for column in zip(*found))
    return Curves(summed(topology, vdot[:, AXIS], vdot[:, 6:]), force)


def difference(a: np.ndarray, b: np.ndarray) -> float:
    """The largest one, in percent of the largest value."""
    return float(100 * abs(a - b).max() / abs(a).max())


def report(run: pg.Result, found: Curves, peers: dict[str, Curves]) -> None:
    """The tables of docs/paper.md."""
    print("| solver | angular accelerations | tip forces |\n|---|---|---|")
    for name, curves in peers.items():
        alpha, force = (difference(a, b) for a, b in zip(found, curves))
        print(f"| {name} | {alpha:.2g} % | {force:.2g} % |")
    print(
        "\n| t [s] | pelvis x, y [m] | tip force of the left back paw x, y, z [N] |\n|---|---|---|"
    )
    paw = list(run.constraint_force).index(PAW)
    for k in pictured(run.t):
        x, y = run.q[k, :2]
        force = ", ".join(f"{f:.2f}" for f in found.force[k, paw].round(2) + 0.0)
        print(f"| {run.t[k]:.2f} | {x:.4f}, {y:.4f} | {force} |")


def pictured(t: np.ndarray) -> list[int]:
    """The frames every 50 ms."""
    return [int(abs(t - time).argmin()) for time in np.arange(0, t[-1] + 1e-9, 0.05)]


def draw(model: pg.Model, run: pg.Result, found: Curves, peers: dict[str, Curves]) -> None:
    """Figs. 10 to 13 with our numbers, as pictures of docs/paper.md."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": "pgraph", "font.size": 9, "figure.facecolor": "white"}
    figures: dict[str, Callable[[Any], None]] = {
        "configurations": lambda plt: configurations(plt, model, run),
        "accelerations": lambda plt: accelerations(plt, run.t, found.alpha),
        "force": lambda plt: force(plt, run, found, peers),
    }
    from matplotlib import pyplot

    for name, figure in figures.items():
        figure(pyplot)
        file = PICTURES / f"stance_{name}.svg"
        pyplot.savefig(file, bbox_inches="tight", metadata={"Date": None})
        pyplot.close()


def configurations(plt: Any, model: pg.Model, run: pg.Result) -> None:
    """Fig. 10: the bodies from the side, as lines from their origins to those of their children."""
    topology = pg.Topology.of(model)
    figure, places = plt.subplots(2, 3, figsize=(9, 5.2), sharex=True, sharey=True)
    for place, k in zip(places.flat, pictured(run.t)):
        at, turn = run.body_pose[k, :, :3], run.body_pose[k, :, 3:]
        for j, name in enumerate(topology.names):
            children = [k for k, parent in enumerate(topology.parent, 1) if parent == j + 1]
            ends = [at[c - 1] for c in children] or [at[j] + turned(turn[j], model.body(name))]
            for end in ends:
                place.plot(*np.array([at[j], end])[:, :2].T, "-o", ms=3, lw=2, color=f"C{j % 10}")
        place.axhline(0, color="0.6", lw=0.8)
        place.set_title(f"{1e3 * run.t[k]:.0f} ms")
        place.set_aspect("equal")
    figure.supxlabel("x [m]")
    figure.supylabel("y [m]")


def turned(wxyz: np.ndarray, body: pg.Body) -> np.ndarray:
    """The tip of a body as seen from its origin, in world axes."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(wxyz, scalar_first=True).apply(body.tip_point)


def accelerations(plt: Any, t: np.ndarray, alpha: np.ndarray) -> None:
    """Figs. 11 and 12: angular acceleration about z of each body."""
    _, places = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True)
    for place, numbers in zip(places, (range(9), range(9, 17))):
        for k in numbers:
            style = "--" if k in MIRRORED else "-"
            place.plot(t, alpha[:, k], style, lw=1.3, label=f"Body {k}")
        place.set_xlabel("t [s]")
        place.legend(fontsize=7, ncol=2)
        place.grid(alpha=0.3)
    places[0].set_ylabel("angular acceleration about z [rad/s²]")


def force(plt: Any, run: pg.Result, found: Curves, peers: dict[str, Curves]) -> None:
    """Fig. 13: the ground's force on the left back paw."""
    paw = list(run.constraint_force).index(PAW)
    plt.figure(figsize=(6, 3.6))
    for i, axis in enumerate("xyz"):
        plt.plot(run.t, found.force[:, paw, i], color=f"C{i}", label=f"F{axis}")
        for style, (name, curves) in zip((":", "--"), peers.items()):
            label = name if i == 2 else None
            plt.plot(run.t, curves.force[:, paw, i], style, color="0.1", lw=0.9, label=label)
    plt.xlabel("t [s]")
    plt.ylabel("force of the ground on the paw [N]")
    plt.legend(fontsize=8)
    plt.grid(alpha=0.3)


def main() -> None:
    """Runs the three solvers, prints the tables, draws."""
    model = pg.Model.load(pgraph_models.path("quadruped"))
    run, found = ours(model)
    peers = {"Pinocchio": by_pinocchio(model, run.t), "MuJoCo": by_mujoco(model, run.t)}
    report(run, found, peers)
    if "--check" not in sys.argv:
        draw(model, run, found, peers)


if __name__ == "__main__":
    main()

"""200 random forests of every kind of joint in one small file: models and states in few digits.

Models and states are rounded to thousandths and read back before anything is computed, so that
text and small integers hold them. Of the oracles' numbers vectors are kept, which see every entry
of M and J through one random direction; MuJoCo's as their difference from Pinocchio's.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.paper.motion import bodies_of

from ..core.trees import State, random_case

FILE = Path(__file__).parent / "forests.npz"
STATE = ("q", "v", "tau", "vdot")
QUANTITIES = ("bias_force", "inverse_dynamics", "forward_dynamics", "tip_velocity", "position")
ORACLES = ("pinocchio", "mujoco")
DIGITS = 3


class Forest(NamedTuple):
    """A state and the results of each oracle: {oracle: {quantity: flat array}}."""

    state: State
    by: dict[str, dict[str, np.ndarray]]


def rounded(seed: int) -> tuple[dict, np.ndarray]:
    """The fields of a random model in few digits, and its state in thousandths."""
    s = random_case(seed)
    fields = json.loads(s.model.to_json())
    for body in fields["bodies"]:  # room for what rounding takes from the triangle inequality
        body["inertia"] = (np.array(body["inertia"]) + 0.002 * np.eye(3)).tolist()
    state = np.concatenate([getattr(s, name) for name in STATE])
    return _short(fields), np.rint(1000 * state).astype(np.int16)


def _short(value):
    """Every number of a JSON value to DIGITS digits, without empty entries."""
    if isinstance(value, dict):
        return {key: _short(x) for key, x in value.items() if x not in (None, [])}
    if isinstance(value, list):
        return [_short(x) for x in value]
    return round(value, DIGITS) if isinstance(value, float) else value


def state_of(fields: dict, thousandths: np.ndarray) -> State:
    """The model and state that text and integers stand for; quaternions at length one."""
    model = pg.Model.from_json(json.dumps(fields))
    topology = pg.Topology.of(model)
    bodies = bodies_of(model, topology)
    nq = sum(joints.nq(b.sequence) for b in bodies)
    q, v, tau, vdot = np.split(thousandths / 1000, nq + np.arange(3) * int(topology.dof.sum()))
    return State(model, topology, _unit(bodies, q), v, tau, vdot, np.zeros((0, 6)))


def _unit(bodies: list[pg.Body], q: np.ndarray) -> np.ndarray:
    i = 0
    for motion in (m for body in bodies for m in body.sequence):
        i += joints.SIZE[motion.kind][0]
        if motion.kind in ("ball", "free"):
            q[i - 4 : i] /= np.linalg.norm(q[i - 4 : i])
    return q


def vectors(state: State, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The quantities that are kept, of an oracle's or our matrices."""
    return {
        "bias_force": values["bias_force"],
        "inverse_dynamics": values["mass_matrix"] @ state.vdot + values["bias_force"],
        "forward_dynamics": values["forward_dynamics"],
        "tip_velocity": values["tip_jacobian"] @ state.v,
        "position": values["position"].reshape(-1),
    }


def save(items: list[tuple[dict, np.ndarray, dict[str, dict[str, np.ndarray]]]]) -> None:
    """Write fields, thousandths and the oracles' vectors of every forest."""
    text = json.dumps([fields for fields, _, _ in items], separators=(",", ":"))
    arrays = {"models": np.frombuffer(text.encode(), np.uint8)}
    arrays["state"] = np.concatenate([state for _, state, _ in items])
    for name in QUANTITIES:
        exact, other = (np.concatenate([by[o][name] for _, _, by in items]) for o in ORACLES)
        arrays[f"pinocchio/{name}"] = exact
        arrays[f"mujoco/{name}"] = (other - exact).astype(np.float32)
    np.savez_compressed(FILE, allow_pickle=False, **arrays)


def load() -> Iterator[Forest]:
    """Every forest of the file."""
    arrays = dict(np.load(FILE))
    taken = dict.fromkeys(arrays, 0)

    def take(name: str, n: int) -> np.ndarray:
        taken[name] += n
        return arrays[name][taken[name] - n : taken[name]]

    for fields in json.loads(arrays["models"].tobytes()):
        bodies = pg.Model.from_json(json.dumps(fields)).bodies
        nv = sum(body.dof for body in bodies)
        nq = sum(joints.nq(body.sequence) for body in bodies)
        state = state_of(fields, take("state", nq + 3 * nv))
        topology = state.topology
        size = dict.fromkeys(QUANTITIES, nv)
        size |= {"tip_velocity": 6 * len(topology.tips), "position": 3 * topology.nb}
        exact = {name: take(f"pinocchio/{name}", n) for name, n in size.items()}
        apart = {name: take(f"mujoco/{name}", n) for name, n in size.items()}
        other = {name: exact[name] + apart[name] for name in QUANTITIES}
        yield Forest(state, {"pinocchio": exact, "mujoco": other})

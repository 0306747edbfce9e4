"""A model and state evaluated by MuJoCo, in our conventions, through MJCF text."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from pgraph_core.peers.elementary import PLACEHOLDER, Row, inertia_of, rows_of
from pgraph_core.peers.in_mujoco import SPECK, coordinates
from pgraph_core.rotation import matrix

TREE_ONLY = 'contact="disable" constraint="disable"'


def evaluate(state) -> dict[str, np.ndarray]:
    """M, C, θ'', the tip Jacobian and the poses of `state` by MuJoCo."""
    rows = rows_of(state.model, state.topology)
    model = mujoco.MjModel.from_xml_string(mjcf(state.model, rows))
    data = mujoco.MjData(model)
    data.qpos[:], T = coordinates(rows, state.q, state.v)
    data.qvel[:] = T @ state.v
    data.qfrc_applied[:] = T @ state.tau  # T is orthogonal
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    tips = [state.topology.names[k - 1] for k in state.topology.tips]
    sites = [data.site(name) for name in state.topology.names]
    return {
        "mass_matrix": T.T @ M @ T,
        "bias_force": T.T @ data.qfrc_bias,
        "forward_dynamics": T.T @ data.qacc,
        "tip_jacobian": np.vstack([_jacobian(model, data, f"{n}/tip") @ T for n in tips]),
        "position": np.array([site.xpos for site in sites]),
        "rotation": np.array([site.xmat.reshape(3, 3) for site in sites]),
    }


def _jacobian(model, data, site: str) -> np.ndarray:
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, linear, angular, model.site(site).id)
    return np.vstack((angular, linear))


def mjcf(model, rows: list[Row], option: str = "", flag: str = TREE_ONLY, extra: str = "") -> str:
    """MJCF text of the rows; a free motion of a root is MuJoCo's free joint."""
    children: dict[int, list[int]] = {}
    for i, row in enumerate(rows):
        children.setdefault(row.parent, []).append(i)
    inner = "".join(_body(rows, children, i) for i in children.get(-1, ()))
    return (
        f'<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/>'
        f'<option gravity="{_text(model.gravity)}" jacobian="dense" {option}>'
        f"<flag {flag}/></option><worldbody>{inner}</worldbody>{extra}</mujoco>"
    )


def _body(rows: list[Row], children: dict[int, list[int]], i: int) -> str:
    row = rows[i]
    inside = _joint(row) + _inertial(row)
    if row.body:
        quat, tip = _text(row.body.rotation), matrix(row.body.rotation) @ row.body.tip_point
        inside += f'<site name="{row.name}" quat="{quat}"/>'
        inside += f'<site name="{row.name}/tip" pos="{_text(tip)}" quat="{quat}"/>'
    inside += "".join(_body(rows, children, k) for k in children.get(i, ()))
    quat = Rotation.from_matrix(row.turn).as_quat(scalar_first=True)
    place = f'pos="{_text(row.shift)}" quat="{_text(quat)}"'
    return f'<body name="{row.name}" {place}>{inside}</body>'


def _joint(row: Row) -> str:
    if row.kind == PLACEHOLDER:
        return ""
    if row.kind == "free" and row.parent < 0:
        return "<freejoint/>"
    if row.kind == "free":
        slides = [f'<joint type="slide" axis="{_text(axis)}"/>' for axis in np.eye(3)]
        return "".join(slides) + '<joint type="ball"/>'
    if row.kind == "ball":
        return '<joint type="ball"/>'
    kind = "hinge" if row.kind == "rotate" else "slide"
    return f'<joint type="{kind}" axis="{_text(row.axis)}" armature="{row.armature!r}"/>'


def _inertial(row: Row) -> str:
    mass, com, inertia = SPECK, np.zeros(3), SPECK * np.eye(3)
    if row.body:
        mass, com, inertia = inertia_of(row.body)
    xx, yy, zz = np.diag(inertia)
    tensor = _text((xx, yy, zz, inertia[0, 1], inertia[0, 2], inertia[1, 2]))
    return f'<inertial pos="{_text(com)}" mass="{mass!r}" fullinertia="{tensor}"/>'


def _text(numbers) -> str:
    return " ".join(repr(float(x)) for x in numbers)

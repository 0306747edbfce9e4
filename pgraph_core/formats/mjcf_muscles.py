"""Muscles of MJCF: actuators of MuJoCo whose gain and bias are those of a muscle."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..forces import Muscle
from ..muscles import MODELS

OF_MUSCLE, STATE_OF_MUSCLE = 2, 4  # mjGAIN_MUSCLE and mjBIAS_MUSCLE, mjDYN_MUSCLE
RANGE = 0.75, 1.05  # lengths of the fibre over l_opt at the ends of `lengthrange`, MuJoCo's default
# numbers of gain and bias: range (2), force, scale, lmin, lmax, vmax, fpmax, fvmax
NUMBERS = 9
SHAPE = {"shortest": 4, "longest": 5, "passive_force": 7, "lengthening": 8}  # their places


def is_muscle(m: Any, a: int) -> bool:
    """Check whether an actuator has the gain, the bias or the state of a muscle."""
    of = m.actuator_gaintype[a], m.actuator_biastype[a]
    return OF_MUSCLE in of or m.actuator_dyntype[a] == STATE_OF_MUSCLE


def why_not(m: Any, a: int, gear: float) -> str:
    """Return what of a muscle no `pg.Muscle` has, or ""."""
    of = m.actuator_gaintype[a], m.actuator_biastype[a]
    if of != (OF_MUSCLE, OF_MUSCLE) or m.actuator_dyntype[a] != STATE_OF_MUSCLE:
        return "an actuator with the gain, the bias or the state of a muscle, without the others"
    gain, bias = m.actuator_gainprm[a, :NUMBERS], m.actuator_biasprm[a, :NUMBERS]
    if (gain != bias).any():
        return "a muscle whose gain and bias differ in their numbers"
    if gear <= 0.0:
        return f"a muscle with a gear of {gear:g}, which would push"
    low, high = m.actuator_lengthrange[a].tolist()
    if not low < high or not gain[0] < gain[1]:
        return "a muscle without a range of lengths"
    return ""


def muscle_of(m: Any, a: int, gear: float) -> dict[str, Any]:
    """Return the fields of a muscle besides its path, with excitation 0."""
    prm, (low, high) = m.actuator_gainprm[a].tolist(), m.actuator_lengthrange[a].tolist()
    force = prm[2] if prm[2] >= 0.0 else prm[3] / float(m.actuator_acc0[a])
    l_opt = (high - low) / (prm[1] - prm[0])
    rise, fall, smooth = m.actuator_dynprm[a, :3].tolist()
    shape = {name: prm[k] for name, k in SHAPE.items()} | {"smoothing": smooth}
    usual = MODELS["mujoco"].shape
    return {
        "model": "mujoco", "f_max": gear * force, "l_opt": l_opt / gear,
        "l_slack": (low - prm[0] * l_opt) / gear, "rise": rise, "fall": fall, "fastest": prm[6],
        "shape": {name: x for name, x in shape.items() if x != usual[name]},
    }  # fmt: skip


def numbers_of(f: Muscle) -> dict[str, Any]:
    """Return the attributes of the actuator of a muscle of model 'mujoco'."""
    shape = {**f.kind_of.shape, **f.shape}
    prm = np.zeros(NUMBERS)
    prm[:4] = *RANGE, f.f_max, 1.0
    prm[6] = f.of_model("fastest")
    for name, k in SHAPE.items():
        prm[k] = shape[name]
    times = f.of_model("rise"), f.of_model("fall"), shape["smoothing"]
    return {
        "dyntype": "muscle", "gaintype": "muscle", "biastype": "muscle",
        "dynprm": times, "gainprm": tuple(prm.tolist()), "biasprm": tuple(prm.tolist()),
        "lengthrange": tuple(f.l_slack + x * f.l_opt for x in RANGE), "ctrlrange": (0.0, 1.0),
    }  # fmt: skip

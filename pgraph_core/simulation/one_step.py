"""The linearised step of a stepper: how a small change of its state leads to one after a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..engine.arrays import Scene
from ..errors import InputError, Problem
from ..packing import Array
from .options import Options
from .recording import Recording
from .sensitivity import Carried, Given, Slope, Variable, directions, slope_of_scenes

GIVEN, DRIVES = Scene._fields.index("given"), Scene._fields.index("drives")


class LinearStep(NamedTuple):
    """δx⁺ = A δx + B δu of one step, to first order.

    x = [ξ, v] has 2 nv entries. ξ are the local coordinates of `Mechanism.linearise`: changes of
    coordinates, and small rotations of balls and free bodies in their parents' axes [rad, m].
    """

    A: Array  # (2 nv, 2 nv)
    B: Array  # (2 nv, inputs) by torques of joints, or by inputs where these are named
    notices: tuple[str, ...] = ()  # why entries are nan


def linear_step(
    own: Recording, options: Options, width: float, tau: Any, inputs: dict[str, tuple[int, float]]
) -> LinearStep:
    """Return the linearised next step, of a width [s], of a recording with torques `tau`.

    `inputs` are {name: (knot, its change with the input)}. Raises InputError.
    """
    mech = own.mech
    nq, nv = mech.nq, mech.nv
    if callable(tau):
        text = "a function of torques has no derivatives: give numbers, motors or servos"
        raise InputError(Problem("Stepper.linearise", "tau", text))
    if len(own.q) > nq:
        text = "has no derivatives yet beside controls with states"
        raise InputError(Problem("Stepper.linearise", "", text))
    plan = replace(
        own.plan, start=(own.q.copy(), own.v.copy()), active=np.array(sorted(own.held)),
        times=np.array([options.t_start, options.t_end]), substeps=np.array([1]),
        width=np.array([width]), shown=None, changes=(), way=None,
    )  # fmt: skip
    record = Recording(mech, plan, plan.start[0], plan.start[1], tau)
    columns = [f"x.{n}" for n in range(2 * nv)]
    columns += list(inputs) or [f"tau.{n}" for n in range(nv)]
    carried = Carried(
        Given(mech, options, plan, tau, None, None, Recording),
        [Variable(name, 1.0, lambda _: (mech, plan)) for name in columns],
    )
    scene = slope_of_scenes([record.scene], [0.0])
    zero = np.zeros(nq), np.zeros(nv)
    for column in directions(mech, plan.start[0]).T:
        carried.slopes.append(Slope(scene, column, zero[1]))
    for one in np.eye(nv):
        carried.slopes.append(Slope(scene, zero[0], one))
    for one in inputs.values() if inputs else range(nv):
        carried.slopes.append(Slope(_acting(scene, one), *zero))
    record.carried = carried
    if not record.begin():
        raise InputError(Problem("Stepper.linearise", "", record.ended.message))
    _remember(record, own)
    record.advance_to_end(None)
    found = carried.of_frames(slice(1, 2))
    slopes = np.column_stack([found[name][0, : nq + nv] for name in columns])
    turned = np.linalg.pinv(directions(mech, record.q))
    both = np.vstack((turned @ slopes[:nq], slopes[nq:]))
    return LinearStep(both[:, : 2 * nv], both[:, 2 * nv :], tuple(carried.ended))


def _acting(scene: Any, one: Any) -> Any:
    """The slope of a scene by the torque of a joint, or by (knot, slope) of an input."""
    parts = list(scene)
    if isinstance(one, tuple):
        drives = list(parts[DRIVES])
        drives[1] = drives[1].copy()
        drives[1][one[0], 1] = one[1]
        parts[DRIVES] = tuple(drives)
    else:
        parts[GIVEN] = np.eye(len(parts[GIVEN]))[one]
    return tuple(parts)


def _remember(record: Recording, own: Recording) -> None:
    """Give a recording what the scene of a stepper remembers of its steps."""
    record.scene.blocks.blocks_f[:] = own.scene.blocks.blocks_f
    if record.scene.touching is not None and own.scene.touching is not None:
        for mine, other in zip(record.scene.touching.memory, own.scene.touching.memory):
            mine[:] = other

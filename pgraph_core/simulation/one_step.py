"""The linearised step of a stepper: how a small change of its state leads to one after a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.lifted import flat, slope_of
from ..engine.arrays import SCENE_OF_DUALS, Scene
from ..errors import InputError, Problem
from ..packing import Array
from .options import Options
from .recording import Recording
from .sensitivity import Carried, directions
from .variables import Given, Slope, Variable

ByInput = tuple[str, int, float]  # a table, its knot that an input moves, the rate of change


class LinearStep(NamedTuple):
    """δx⁺ = A δx + B δu of one step, to first order.

    x = [ξ, v] has 2 nv entries. ξ are the local coordinates of `Mechanism.linearise`: changes of
    coordinates, and small rotations of balls and free bodies in their parents' axes [rad, m].
    """

    A: Array  # (2 nv, 2 nv)
    B: Array  # (2 nv, inputs) by torques of joints, or by inputs where these are named
    notices: tuple[str, ...] = ()  # why entries are nan


def linear_step(
    own: Recording, options: Options, width: float, tau: Any, inputs: dict[str, ByInput]
) -> LinearStep:
    """Compute the linearised next step, of a width [s], of a recording with torques `tau`.

    Raises InputError.
    """
    mech = own.mech
    nq, nv = mech.nq, mech.nv
    if callable(tau):
        text = "derivatives are not supported for torque functions; use numbers, motors or servos"
        raise InputError(Problem("Stepper.linearise", "tau", text))
    if len(own.q) > nq:
        text = "does not support derivatives in combination with control states"
        raise InputError(Problem("Stepper.linearise", "", text))
    plan = replace(
        own.plan, start=(own.q.copy(), own.v.copy()), active=own.active,
        times=np.array([options.t_start, options.t_end]), substeps=np.array([1]),
        width=np.array([width]), shown=None, changes=(), way=None,
    )  # fmt: skip
    record = Recording(mech, plan, plan.start[0], plan.start[1], tau)
    columns = [f"x.{n}" for n in range(2 * nv)]
    columns += list(inputs) or [f"tau.{n}" for n in range(nv)]
    carried = Carried(
        Given(mech, options, plan, tau, None, None),
        [Variable(name, 1.0, lambda _: (mech, plan)) for name in columns],
    )
    arrays = record.scene.arrays
    scene, zero = _acting(arrays), (np.zeros(nq), np.zeros(nv))
    for column in directions(mech, plan.start[0]).T:
        carried.slopes.append(Slope(scene, column, zero[1]))
    for one in np.eye(nv):
        carried.slopes.append(Slope(scene, zero[0], one))
    for one in inputs.values() if inputs else range(nv):
        carried.slopes.append(Slope(_acting(arrays, one), *zero))
    record.carried = carried
    if not record.begin():
        raise InputError(Problem("Stepper.linearise", "", record.ended.message))
    # what the scene of a stepper remembers of its steps
    record.scene.blocks.blocks_f[:] = own.scene.blocks.blocks_f
    if record.scene.touching is not None and own.scene.touching is not None:
        for mine, other in zip(record.scene.touching.memory, own.scene.touching.memory):
            mine[:] = other
    record.advance_to_end(None)
    found = carried.of_frames(slice(1, 2))
    slopes = np.column_stack([found[name][0, : nq + nv] for name in columns])
    turned = np.linalg.pinv(directions(mech, record.q))
    both = np.vstack((turned @ slopes[:nq], slopes[nq:]))
    return LinearStep(both[:, : 2 * nv], both[:, 2 * nv :], tuple(carried.ended))


def _acting(scene: Scene, one: int | ByInput | None = None) -> Array:
    """Return the slope of a scene by the torque of a joint, or by an input.

    It is zero if `one` is None.
    """
    none, ends = np.zeros(len(scene.given)), []
    for share in (0.0, 1.0):
        given, drives, loads = none, scene.drives, scene.loads
        if isinstance(one, tuple):
            of, knot, slope = one
            table, knots, *others = (*drives,) if of == "drives" else getattr(loads, of)
            knots = knots.copy()
            knots[knot, 1] = share * slope
            if of == "drives":
                drives = drives._replace(knots=knots)
            else:
                loads = loads._replace(**{of: (table, knots, *others)})
        elif one is not None:
            given = share * np.eye(len(none))[one]
        ends.append(flat(SCENE_OF_DUALS, scene._replace(given=given, drives=drives, loads=loads)))
    return slope_of(ends, (0.0, 1.0))

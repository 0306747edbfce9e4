"""Static optimisation: activations of muscles that exert given torques."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear, minimize

from ..dynamics import Dynamics
from ..errors import InputError, Problem, choices, counted, explained, nearest_name, shown
from ..forces import Activated
from ..packing import Array
from ..tolerances import NOTABLE, ROUNDING, SOLVED, step_of_differences

STEPS = 200  # the most steps of an optimisation, which takes about ten
STEP = step_of_differences(2)  # by an activation, in which tensions are linear or nearly so


@explained
@dataclass(frozen=True, eq=False)
class Activations:
    """The activations of the muscles that exert given torques, with the least sum of squares."""

    activation: Mapping[str, float]  # the activation of each muscle, by its name
    tension: Mapping[str, float]  # the tension of each muscle [N]
    torque: Mapping[str, float]  # the torques that they exert on the coordinates [N m, N]
    notices: tuple[str, ...] = ()  # a sentence for each torque that they do not reach


def activations(mech: Dynamics, torques: Mapping[str, float], q: Array, v: Array) -> Activations:
    """Return activations that exert these torques {coordinate: N m, N} at q and v.

    All tendons are rigid here, as usual for static optimisation. Raises InputError.
    """
    places = _places(mech, torques)
    muscles = [f for f in mech.model.forces if isinstance(f, Activated)]
    if not muscles:
        raise InputError(Problem("activations", "", "the model has no muscle; add a pg.Muscle"))
    rows = [mech.path_names.index(f.name) for f in muscles]
    lengths, arms = mech.path_length(q)[rows], mech.moment_arms(q)[rows]
    rates, arms = -arms @ v, arms[:, places]
    whole = np.where(mech.packed.slides[places], 1.0, lengths[:, None])
    arms = np.where(np.abs(arms) > ROUNDING * whole, arms, 0.0)
    wanted = np.array([float(x) for x in torques.values()])

    def tensions(a: Array) -> Array:
        given = zip(muscles, a.tolist(), lengths.tolist(), rates.tolist())
        return np.array([f.tension_with_rigid_tendon(*x) for f, *x in given])

    def slopes(a: Array) -> Array:
        inner = np.clip(a, least + STEP, 1.0 - STEP)
        return (tensions(inner + STEP) - tensions(inner - STEP)) / (2.0 * STEP)

    least = np.array([f.least for f in muscles])
    size = np.abs(arms.T) @ tensions(np.ones(len(muscles))) + np.abs(wanted)
    acted = size > 0.0  # no muscle acts on others, which get the torque 0 that they ask for
    miss = lambda a: ((arms.T @ tensions(a) - wanted) / (size + ~acted))[acted]  # noqa: E731
    slope = lambda a: (arms.T * slopes(a))[acted] / size[acted, None]  # noqa: E731
    start, ended = _nearest(miss, slope, least), ""
    if np.abs(miss(start)).max(initial=0.0) <= NOTABLE:
        bases, sizes, _ = np.linalg.svd(slope(start), full_matrices=False)
        own = bases[:, sizes > SOLVED * sizes.max(initial=0.0)].T  # rows may depend on each other
        found = minimize(
            lambda a: (a @ a, 2.0 * a), start, jac=True, method="SLSQP",
            bounds=[(x, 1.0) for x in least.tolist()],
            constraints={
                "type": "eq", "fun": lambda a: own @ miss(a), "jac": lambda a: own @ slope(a)
            },
            options={"ftol": SOLVED, "maxiter": STEPS},
        )  # fmt: skip
        best = np.clip(found.x, least, 1.0)
        if np.abs(miss(best)).max(initial=0.0) <= NOTABLE:
            start = best
        ended = "" if found.success else f"the sum of squares may not be the least: {found.message}"
    forces = tensions(start)
    exerted = arms.T @ forces
    short = np.abs(exerted - wanted) > NOTABLE * size
    notices = ((ended,) if ended else ()) + tuple(
        f"the muscles do not reach {want:.4g} at {name}: they exert {got:.4g} here, with the "
        "activations nearest to all torques"
        for name, want, got, bad in zip(torques, wanted.tolist(), exerted.tolist(), short) if bad
    )  # fmt: skip
    names = [f.name for f in muscles]
    return Activations(
        dict(zip(names, start.tolist())), dict(zip(names, forces.tolist())),
        dict(zip(torques, exerted.tolist())), notices,
    )  # fmt: skip


def _nearest(miss: Any, slope: Any, least: Array) -> Array:
    """Return activations within their bounds whose torques are the nearest to the given ones."""
    a = np.clip(np.full(len(least), 0.1), least, 1.0)
    for _ in range(STEPS):
        matrix = slope(a)
        new = lsq_linear(matrix, matrix @ a - miss(a), (least, np.ones(len(a)))).x
        moved, a = np.abs(new - a).max(), new
        if moved <= SOLVED:
            break
    return a


def _places(mech: Dynamics, torques: Any) -> list[int]:
    """Return the index into v of each named coordinate. Raises InputError."""
    if not isinstance(torques, Mapping) or not torques:
        text = f"must be torques by joint, such as {{'knee': 40.0}}, got {shown(torques)}"
        raise InputError(Problem("activations", "torques", text))
    found = []
    for given, value in torques.items():
        name, _, k = (given, "", "") if given in mech.joints else str(given).rpartition(".")
        if name not in mech.joints:
            text = f"no joint is named {shown(given)}; {nearest_name(str(given), mech.joints)}"
            raise InputError(Problem("activations", "torques", text))
        own = range(mech.nv)[mech.joints[name].v]
        if not (k.isdigit() and int(k) < len(own)) and not (len(own) == 1 and not k):
            all_of = choices(f"{name}.{i}" for i in range(len(own)))
            text = f"'{name}' has {counted(len(own), 'coordinate')}; name one of {all_of}"
            raise InputError(Problem("activations", "torques", text))
        if not isinstance(value, (int, float)) or not np.isfinite(value):
            text = f"must be a finite number [N m, N], got {shown(value)}"
            raise InputError(Problem("activations", f"torques[{given!r}]", text))
        found.append(own[int(k or 0)])
    return found

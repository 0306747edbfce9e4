"""Masses, mass centres and inertias from measured motions and torques.

Torques are linear in the inertial parameters, τ = Y π (`Mechanism.regressor`). Weighted least
squares find those that the data determine; the others stay at the values of the model. Bodies are
kept possible: the pseudo-inertia of each, with density moments in place of inertias, is positive
definite (Wensing, Kim and Slotine, IEEE Robotics and Automation Letters 3 (2018) 60-67).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..analysis.mobility import complement, judged
from ..analysis.rows import Rows
from ..dynamics.arguments import finite
from ..dynamics.many import (
    COLUMNS,
    PARAMETERS,
    ROWS,
    parameter_names,
    parameters,
    regressor,
    torques,
)
from ..errors import choices, counted, explained, refusal
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..tolerances import EPS, NAMED, NOTABLE, SOLVED
from .trial import Array, known

TERMS = 6  # most terms of a combination in a sentence
ROUNDS = 50  # steps of one share of the barrier at most


@explained
@dataclass(frozen=True, eq=False)
class Inertias:
    """Masses and inertias that were identified, with their standard errors.

    `parameters` are ten numbers for each body, as of `Mechanism.inertial_parameters`.
    """

    model: Model  # with the numbers found
    names: tuple[str, ...]  # names of the parameters, such as "mass of 'hand'"
    parameters: Array  # (10 nb,)
    errors: Array  # (10 nb,) standard errors, nan where the data do not determine a parameter
    combinations: Mapping[str, tuple[float, float]]
    """{text: (value, standard error)} of all that the data determine."""
    undetermined: tuple[str, ...]  # sentences
    residual: Array  # (n, nv) measured torques minus those of the model found
    noise: Array  # (nv,) standard deviations of the torques, as left by the fit
    report: tuple[str, ...] = ()

    def __repr__(self) -> str:
        lines = [f"<Inertias: {counted(len(self.combinations), 'combination')} of "
                 f"{counted(int((self.errors != 0.0).sum()), 'parameter')} determined"]  # fmt: skip
        for text, (value, error) in self.combinations.items():
            lines.append(f"{text} = {value:.6g} ± {error:.2g}")
        return "\n  ".join((*lines, *self.undetermined, *self.report)) + ">"


@explained
def identify_inertia(
    mechanism: Model | Mechanism,
    q: Any,
    v: Any,
    vdot: Any,
    torque: Any,
    *,
    external: Any = None,
    bodies: Iterable[str] | None = None,
) -> Inertias:
    """Find masses, mass centres and inertias of bodies from a motion and its torques.

    Parameters
    ----------
    mechanism : Model or Mechanism
        The model. Its numbers stay where the data do not determine others.
    q, v, vdot : (n, nq), (n, nv) and (n, nv) arrays
        Measured motion.
    torque : (n, nv) array
        Torques and forces of the joints [N m, N], 0 where nothing drives. Passive forces and
        armature of the model act in addition.
    external : (n, nb, 6) array, optional
        [torque, force] on bodies at their origins in world axes, such as `Moments.external`.
    bodies : iterable of str, optional
        Names of the bodies that are identified, by default all.

    Returns
    -------
    Inertias
        `model`, `combinations` with standard errors, and what the data do not determine.

    Raises
    ------
    InputError
        If shapes do not fit, or the data are fewer than the parameters that they show.

    Examples
    --------
        found = pg.identify_inertia(arm, q, v, vdot, tau, bodies=["hand"])
        print(found)
    """
    mech = mechanism_of(mechanism, "identify_inertia")
    q = np.atleast_2d(np.asarray(q))
    n = len(q)
    q = finite("q", q, n, mech.nq)
    v, vdot, torque = (
        finite(name, x, n, mech.nv) for name, x in (("v", v), ("vdot", vdot), ("torque", torque))
    )
    loads = None if external is None else finite("external", external, n, mech.nb, 6)
    wanted = list(mech.names if bodies is None else bodies)
    for name in wanted:
        known("identify_inertia", "bodies", "body", name, mech.names)
    free = np.concatenate([np.arange(PARAMETERS) + PARAMETERS * (mech.topology.number(x) - 1)
                           for x in wanted]) if wanted else np.zeros(0, dtype=np.int64)  # fmt: skip
    prior, Y = parameters(mech), regressor(mech, q, v, vdot)
    # what the model's own numbers leave: armature, passive and external forces act as they are
    left = torque - torques(mech, q, v, vdot, loads)
    rows = Y[:, :, free]
    if len(mech.packed.active):  # forces of loops drop out in the velocities that they permit
        base = Rows.of(mech, mech.packed.active, q[0])
        ways = [complement(judged(base.at(x))[0], mech.nv) for x in q]
        free_ways = [base.at(x).step(way).T for x, way in zip(q, ways)]
        blocks = [way @ y for way, y in zip(free_ways, rows)]
        rest = [way @ x for way, x in zip(free_ways, left)]
        each = [np.arange(len(way)) for way in free_ways]
    else:
        blocks, rest, each = list(rows), list(left), [np.arange(mech.nv)] * n
    A, b, row = np.vstack(blocks), np.concatenate(rest), np.concatenate(each)
    return _identified(mech, wanted, free, prior, (A, b, row), (Y, left))


def _identified(
    mech: Mechanism,
    wanted: list[str],
    free: Array,
    prior: Array,
    system: tuple[Array, Array, Array],
    whole: tuple[Array, Array],
) -> Inertias:
    A, b, row = system
    scale = _scales(mech, prior)[free]
    weight = np.ones(len(b))
    rounds = 0
    while True:  # weighted by the noise that the last fit left
        step, space, sizes = _least(A, b, weight, scale)
        missed = b - A @ step
        freedom = len(b) - len(sizes)
        if freedom <= 0:
            text = f"are {counted(len(b), 'number')}, and show {counted(len(sizes), 'parameter')}; "
            raise refusal("identify_inertia", "torque", text + "give more samples")
        spread = np.array([np.sqrt(np.mean(missed[row == i] ** 2)) if (row == i).any() else 0.0
                           for i in range(row.max() + 1)])  # fmt: skip
        least = SOLVED * max(float(np.abs(b).max(initial=0.0)), float(spread.max()), SOLVED)
        if rounds == 2:
            break
        weight, rounds = 1 / np.maximum(spread, least)[row], rounds + 1
    variance = float((missed * weight) @ (missed * weight)) / freedom
    shown, hidden = space
    covariance = variance * (shown / sizes**2) @ shown.T  # covariance of the scaled parameters
    names = parameter_names(mech)
    own = [names[i] for i in free]
    found, report = prior.copy(), list[str]()
    found[free] += step
    if bad := [x for x in wanted if not _possible(found, mech, x)]:
        report.append(f"without a condition, {choices(bad, 6)} would be no possible body; the "
                      "nearest possible numbers were taken")  # fmt: skip
        found[free] = _kept_possible(mech, wanted, prior, (A, b, weight), scale)
    errors = np.full(len(prior), 0.0)
    errors[free] = scale * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    lost = np.abs(hidden).max(axis=1, initial=0.0) > NOTABLE
    errors[free[lost]] = np.nan
    Y, left = whole
    residual = left - np.einsum("nij,j->ni", Y, found - prior)
    return Inertias(
        _edited(mech, wanted, found), tuple(names), found, errors,
        _combinations(shown, covariance, scale, found[free], own),
        tuple(_undetermined(own, hidden)), residual,
        np.sqrt(np.mean(residual**2, axis=0)), tuple(report),
    )  # fmt: skip


def _scales(mech: Mechanism, prior: Array) -> Array:
    """Return a size of each parameter (10 nb,), by the mean mass and the mechanism's length."""
    mass = float(np.mean(prior[::PARAMETERS])) or 1.0
    length = mech.packed.length
    powers = np.array([0, 1, 1, 1, *[2] * 6])
    return np.tile(mass * length**powers, mech.nb)


def _least(
    A: Array, b: Array, weight: Array, scale: Array
) -> tuple[Array, tuple[Array, Array], Array]:
    """Return the smallest least-squares step (p,), the (shown, hidden) directions, and sizes."""
    scaled = A * weight[:, None] * scale
    R = _reduced(np.column_stack((scaled, weight * b)))
    p = len(scale)
    left, sizes, right = np.linalg.svd(R[:, :p])
    kept = int((sizes > SOLVED * sizes.max(initial=0.0)).sum())
    y = left[:, :kept].T @ R[:, p]
    shown, hidden = right[:kept].T, right[kept:].T
    return scale * (shown @ (y / sizes[:kept])), (shown, hidden), sizes[:kept]


def _reduced(rows: Array) -> Array:
    """Return the triangle (p, p) of rows (n, p) that are orthogonalised, zero-filled if n < p.

    Blocks are added one after another: solvers of large ones wait for busy processors.
    """
    p = rows.shape[1]
    found = np.zeros((p, p))
    for first in range(0, len(rows), p):
        found = np.asarray(np.linalg.qr(np.vstack((found, rows[first : first + p])), mode="r"))
    return found


def _pseudo(numbers: Array) -> Array:
    """Return the pseudo-inertia (4, 4) of ten parameters."""
    inertia = np.zeros((3, 3))
    inertia[ROWS, COLUMNS] = inertia[COLUMNS, ROWS] = numbers[4:]
    found = np.empty((4, 4))
    found[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
    found[:3, 3] = found[3, :3] = numbers[1:4]
    found[3, 3] = numbers[0]
    return found


def _numbers(pseudo: Array) -> Array:
    """Return the ten parameters of a pseudo-inertia (4, 4)."""
    inertia = np.trace(pseudo[:3, :3]) * np.eye(3) - pseudo[:3, :3]
    return np.array([pseudo[3, 3], *pseudo[:3, 3], *inertia[ROWS, COLUMNS]])


def _span(mech: Mechanism, name: str) -> slice:
    first = PARAMETERS * (mech.topology.number(name) - 1)
    return slice(first, first + PARAMETERS)


def _possible(found: Array, mech: Mechanism, name: str) -> bool:
    """Return whether the numbers of a body are those of a distribution of mass."""
    pseudo = _pseudo(found[_span(mech, name)])
    size = np.sqrt(np.maximum(np.abs(np.diag(pseudo)), SOLVED**2))
    least = float(np.linalg.eigvalsh(pseudo / size / size[:, None])[0])
    return least > -SOLVED and pseudo[3, 3] > 0.0


def _kept_possible(
    mech: Mechanism,
    wanted: list[str],
    prior: Array,
    system: tuple[Array, Array, Array],
    scale: Array,
) -> Array:
    """Return the parameters of least squares among possible bodies, near the prior where hidden.

    The log-determinant divergence of the pseudo-inertias from those of the prior is added, with a
    share that falls to nearly nothing: a barrier that is convex in the parameters, so that steps of
    Newton, shortened to 1 / (1 + decrement), never leave the possible bodies.
    """
    A, b, weight = system
    R = _reduced(np.column_stack((A * weight[:, None] * scale, weight * b)))
    slope, right = R[:, : len(scale)], R[:, len(scale)]
    parts = [slice(PARAMETERS * k, PARAMETERS * (k + 1)) for k in range(len(wanted))]
    basis = np.array([_pseudo(one) for one in np.eye(PARAMETERS)])
    start, first = np.zeros(len(scale)), list[Array]()
    for name, part in zip(wanted, parts):
        root = np.sqrt(scale[part][[4, 4, 4, 0]])
        pseudo = _pseudo(prior[_span(mech, name)])
        values, ways = np.linalg.eigh(pseudo / root / root[:, None])
        inside = (ways * np.maximum(values, NOTABLE * values.max())) @ ways.T * root * root[:, None]
        start[part] = (_numbers(inside) - prior[_span(mech, name)]) / scale[part]
        first.append(np.linalg.inv(inside))
    x = start.copy()
    before = np.concatenate([prior[_span(mech, name)] for name in wanted])
    largest = float(np.linalg.norm(slope, 2))
    share, last = largest**2, max(NOTABLE, (SOLVED * largest) ** 2)
    while share >= last:
        kept = x
        for _ in range(ROUNDS):
            pull, root = np.zeros(len(x)), np.zeros((len(x), len(x)))
            for part, inverse in zip(parts, first):
                now = np.linalg.inv(_pseudo((before + scale * x)[part]))
                turned = now @ (basis * scale[part][:, None, None])
                bend = np.einsum("aij,bji->ab", turned, turned)
                if np.linalg.cond(bend) > 1 / EPS:  # at the edge of what is possible
                    return before + scale * kept
                root[part, part] = np.linalg.cholesky((bend + bend.T) / 2)
                pull[part] = scale[part] * np.einsum("ij,aji->a", inverse - now, basis)
            rows = np.vstack((slope, np.sqrt(share) * root.T))
            aim = np.concatenate((right - slope @ x, -np.sqrt(share) * np.linalg.solve(root, pull)))
            small = _reduced(np.column_stack((rows, aim)))
            step = np.linalg.solve(small[: len(x), : len(x)], small[: len(x), len(x)])
            far = float(np.linalg.norm(root.T @ step))
            x = x + step / (1 + far) if far > NAMED else x + step
            if far <= NAMED:
                break
        share /= 100
    return before + scale * x


def _edited(mech: Mechanism, wanted: list[str], found: Array) -> Model:
    """Return the model with the numbers found."""
    model = mech.model
    for name in wanted:
        m, c, rest = np.split(found[_span(mech, name)], [1, 4])
        mass = max(float(m[0]), 0.0)
        com = c / mass if mass > 0.0 else 0 * c
        inertia = np.zeros((3, 3))
        inertia[ROWS, COLUMNS] = inertia[COLUMNS, ROWS] = rest
        inertia -= mass * (com @ com * np.eye(3) - np.outer(com, com))
        size = max(float(np.abs(inertia).max()), float(np.abs(rest).max()))
        inertia[np.abs(inertia) <= SOLVED * size] = 0.0  # a point mass has none
        fields = {"mass": mass, "com": tuple(com.tolist()), "inertia": inertia.tolist()}
        model = model.edit(name, derived=(), density=None, any_inertia=True, **fields)
    return model


# -- sentences -------------------------------------------------------------------------------------


def _combinations(
    shown: Array, covariance: Array, scale: Array, found: Array, names: list[str]
) -> dict[str, tuple[float, float]]:
    """Return what the data determine, each as a parameter with its partners.

    The rows of the shown space are reduced, so that each has a parameter that no other has.
    """
    rows = shown.T / scale  # combinations of the parameters in their own units
    size = np.abs(rows * scale)
    rows, pivots, k = rows * 1.0, list[int](), 0
    for j in range(len(names)):
        if k == len(rows):
            break
        best = k + int(np.abs(rows[k:, j]).argmax())
        if np.abs(rows[best, j]) * scale[j] <= NOTABLE * float(size.max(initial=0.0)):
            continue
        rows[[k, best]] = rows[[best, k]]
        rows[k] /= rows[k, j]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, j], rows[k])
        pivots.append(j)
        k += 1
    told: dict[str, tuple[float, float]] = {}
    for row, j in zip(rows, pivots):
        share = np.abs(row * scale) / scale[j]
        terms = [i for i in np.flatnonzero(share > NOTABLE) if i != j]
        text = names[j]
        for i in terms[:TERMS]:
            sign, number = ("-" if row[i] < 0 else "+"), abs(row[i])
            factor = "" if abs(number - 1) < NOTABLE else f"{number:.4g} "
            text += f" {sign} {factor}{names[i]}"
        text += f" and {len(terms) - TERMS} more" if len(terms) > TERMS else ""
        error = float(np.sqrt(max((row * scale) @ covariance @ (row * scale), 0.0)))
        told[text] = float(row @ found), error
    return told


def _undetermined(names: list[str], hidden: Array) -> list[str]:
    """Return sentences on the parameters without effect, and on those known in combinations."""
    if not hidden.shape[1]:
        return []
    part = np.linalg.norm(hidden, axis=1)
    none = [x for x, size in zip(names, part) if size > 1 - NOTABLE]
    some = [x for x, size in zip(names, part) if NOTABLE < size <= 1 - NOTABLE]
    told = [f"no effect on the torques: {', '.join(none)}"] if none else []
    return told + ([f"known in combinations alone: {', '.join(some)}"] if some else [])

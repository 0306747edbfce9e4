"""What the cells of a row are compared with: a run far finer than theirs, checked by another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..errors import PgraphError
from ..integrators import METHODS
from ..mechanism import Mechanism
from ..mechanism.scale import length_of
from ..result import Result
from ..simulation import simulate
from ..simulation.plan import fastest_rate
from ..system import Array
from .runs import per_step

SAME = 1e-12  # of the duration: times closer than this are one
LARGE = 20  # degrees of freedom from which implicit methods cost too much for a second opinion
FINER = 1e-7  # the tolerance of the reference, of the largest error that is OK
RESOLVED = 3e5  # radians of the fastest oscillation that explicit methods are let follow
PATIENCE = 10  # times the budget of a cell
TRUST = 10.0  # times its own estimate: how far another run may be off
STATES = 5  # at which the fastest rate is looked for
Progress = Callable[[float], Any]


class Reference(NamedTuple):
    """A row's motion as well as it is known."""

    run: Result
    accuracy: float  # largest error of it, as of cells
    how: str
    rate: float  # the fastest of the motion [1/s]
    energy: float  # range of its energies [J]

    def at(self, t: Array) -> Array:
        """(len(t), nq) at these times, which are among its own."""
        return self.run.q[np.searchsorted(self.run.t, t * (1 - SAME) - 1e-300)]


def merged(times: list[Array], t_end: float) -> Array:
    """All times, once each, in order."""
    every = np.unique(np.concatenate(times))
    apart = np.diff(every, prepend=-t_end) > SAME * t_end
    return every[apart]


def misses(mech: Mechanism, q: Array, other: Array) -> Array:
    """(n, rows) difference of two motions: turns [rad], slides over the mechanism's length."""
    rows = mech.system.rows[1:].tolist()
    found = np.zeros((len(q), len(rows)))
    size = length_of(mech)
    for k, (_, kind, i, _) in enumerate(rows):
        a, b = q[:, i : i + 7], other[:, i : i + 7]
        if kind == at.ROTATE:
            found[:, k] = np.abs(a[:, 0] - b[:, 0])
        elif kind == at.TRANSLATE:
            found[:, k] = slid(a[:, :1], b[:, :1], size)
        elif kind == at.BALL:
            found[:, k] = turned(a[:, :4], b[:, :4])
        else:
            found[:, k] = np.maximum(slid(a[:, :3], b[:, :3], size), turned(a[:, 3:], b[:, 3:]))
    return np.where(np.isfinite(found), found, np.inf)


def slid(x: Array, y: Array, size: float) -> Array:
    """(n,) distance over the mechanism's length, or how far y gets where that is more."""
    scale = max(size, float(np.abs(y).max(initial=0.0)))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.linalg.norm(x - y, axis=1) / (scale or 1.0)


def turned(x: Array, y: Array) -> Array:
    """(n,) angle between two orientations [rad]."""
    near = np.minimum(np.linalg.norm(x - y, axis=1), np.linalg.norm(x + y, axis=1))
    return 4.0 * np.arcsin(np.clip(near / 2, 0.0, 1.0))


def energy_range(run: Result) -> float:
    """The largest range of the energies of a run [J]."""
    parts = (run.kinetic_energy, run.potential_energy, run.work, run.dissipation)
    return max(max(float(np.ptp(x)) for x in parts), float(run.kinetic_energy.max()))


def reference(
    mech: Mechanism,
    times: Array,
    finest: float,
    target: float,
    budget: int,
    progress: Progress,
) -> Reference | None:
    """The best of the runs that reach the end of `times`; None where none does.

    Two of them are compared: what they differ by is how well the motion is known, or what the
    better one estimates of itself where the other is off by no more than it says it is.
    Raises PgraphError where no method takes the scene.
    """
    rate = rate_of(mech, [mech.home()])
    options = {"t_end": float(times[-1]), "t_eval": times, "progress": progress}
    done: list[tuple[Result, float]] = []
    rtol = min(1e-9, max(FINER * target, 1e-12))
    allowed = PATIENCE * budget // len(mech.system.rows)
    given = (mech.nv, rate * times[-1], has_impulses(mech), finest, rtol, allowed)
    refused: PgraphError | None = None
    for setting in _candidates(*given):
        try:
            run = simulate(mech, **options, **setting)
        except PgraphError as error:
            refused = error
            continue
        if run.status.ok:
            done.append((run, _own_accuracy(mech, run)))
        if len(done) == 2:
            break
    if not done:
        if refused is not None:
            raise refused
        return None
    return _judged(mech, done, rate)


def _own_accuracy(mech: Mechanism, run: Result) -> float:
    """What a run estimates of itself; slides are in metres there."""
    length = length_of(mech) or 1.0
    return float(run.error_estimate) * max(1.0, 1.0 / length)


def _judged(mech: Mechanism, done: list[tuple[Result, float]], rate: float) -> Reference:
    run, accuracy = min(done, key=lambda pair: np.nan_to_num(pair[1], nan=np.inf))
    how = f"{_setting(run)}, by its own estimate"
    if len(done) == 2:
        other, theirs = done[0] if done[1][0] is run else done[1]
        apart = float(misses(mech, run.q, other.q).max(initial=0.0))
        bounded = apart <= TRUST * theirs  # a coarse second run bears out a fine first one
        accuracy = min(apart, accuracy) if bounded else apart
        how = f"{_setting(run)} and {_setting(other)}"
    some = np.linspace(0, len(run.t) - 1, STATES).astype(int)
    rate = max(rate, rate_of(mech, [(run.q[i].copy(), run.v[i].copy()) for i in some]))
    accuracy = accuracy if np.isfinite(accuracy) else np.inf
    return Reference(run, accuracy, how, rate, energy_range(run))


def _setting(run: Result) -> str:
    rtol, step = run.header["rtol"], run.header["step"]
    return f"{run.header['method']} {f'step {step:g} s' if rtol is None else f'rtol {rtol:g}'}"


def rate_of(mech: Mechanism, states: list[tuple[Array, Array]]) -> float:
    """The fastest rate at some states [1/s]; 0 with contacts, whose stiffness it would not see."""
    if mech.contacts(tuple(c for c in mech.model.contacts if c.active)) is not None:
        return 0.0
    acts = (mech.drives(mech.model.forces), mech.loads(mech.model.forces))
    return max(fastest_rate(mech, acts, mech.active, q, v) for q, v in states)


def has_impulses(mech: Mechanism) -> bool:
    """Whether a run needs impulses: at rigid contacts and joint limits."""
    contacts = mech.contacts(tuple(c for c in mech.model.contacts if c.active))
    return contacts is not None and contacts.rigid


def _candidates(
    nv: int, radians: float, impulses: bool, finest: float, rtol: float, budget: int
) -> Iterator[dict[str, Any]]:
    """Settings to try until two of them reach the end."""
    if impulses:
        yield {"method": "rk4", "step": finest / 2}
        yield {"method": "moreau_jean", "step": finest / 2}
        yield {"method": "moreau_jean", "step": finest / 4}
        return
    choice = [("dop853", rtol), ("dopri5", 10 * rtol)] if radians < RESOLVED else []
    if nv <= LARGE:
        choice = [("radau5", rtol), *choice]
    for name, tolerance in (*choice, ("radau5", 10 * rtol)):
        most = budget // per_step(METHODS[name], nv)
        yield {"method": name, "rtol": tolerance, "max_steps": max(most, 1)}

"""Joint moments of a tracked motion with force plates, and their 95 % band.

M v' + C = τ + Jᵀ w of the plates. The band is that of `band`, whatever the filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.mobility import complement, judged
from ..analysis.rows import Rows
from ..dynamics.arguments import wrong_type
from ..dynamics.many import motions, plan, torques
from ..errors import choices, counted, explained, needed, percent, refusal, shown
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..result.columns import Column, coordinates
from ..tolerances import NOTABLE
from .band import band as band_of
from .filters import Sampled, checked, moved
from .markers import Progress, tell
from .tracking import Tracking, followed, to_csv
from .trial import Array, Plate, Trial, known

AUTO = "auto"  # the body that is nearest to a plate while it is loaded


@explained
@dataclass(frozen=True, eq=False)
class Moments:
    """Joint moments of a tracked motion, with the forces that a root would have to bear.

    `print(loads)` tells which plate bears which body, and the residuals of the root.
    """

    mechanism: Mechanism
    t: Array  # (n,) [s]
    q: Array  # (n, nq) filtered
    v: Array  # (n, nv)
    vdot: Array  # (n, nv)
    torque: Array  # (n, nv) [N m, N] by velocity
    names: tuple[str, ...]  # names of the velocities, or of outputs of their joint
    low: Array | None  # (n, nv) lower and upper end of the 95 % band
    high: Array | None
    external: Array  # (n, nb, 6) [torque, force] of plates on bodies at their origins, world axes
    residual: tuple[str, ...]  # names of root coordinates, which nothing drives
    share: Array  # (n, r) their forces over the weight, and torques over weight times length
    bears: Mapping[str, tuple[tuple[str, float, float, float], ...]]
    """{plate: ((body, start [s], end [s], mean distance [m]), ...)}."""
    report: tuple[str, ...] = ()

    def __repr__(self) -> str:
        lines = [f"<Moments: {counted(len(self.t), 'frame')}, {counted(len(self.names), 'torque')}"]
        for plate, spells in self.bears.items():
            for body, start, end, far in spells:
                lines.append(f"{plate} bears {body} from {start:.3g} to {end:.3g} s, "
                             f"{far:.2g} m from its nearest point")  # fmt: skip
        for name, x in zip(self.residual, np.abs(self.share).T):
            lines.append(f"residual of {name}: {100 * np.sqrt(np.mean(x**2)):.3g} % rms, "
                         f"{100 * x.max(initial=0.0):.3g} % at most, of the weight")  # fmt: skip
        return "\n  ".join((*lines, *self.report)) + ">"

    def columns(self) -> dict[str, Array]:
        """Return t, the torques, "NAME.low" and "NAME.high" of the band, and the shares of the
        weight "residual.NAME", as {name: (n,)}."""
        return {name: column.values for name, column in self._columns().items()}

    def _columns(self) -> dict[str, Column]:
        found = {"t": Column("s", self.t)}
        units = ["N m" if unit == "rad" else "N" for _, unit in coordinates(self.mechanism)[1]]
        for i, (name, unit) in enumerate(zip(self.names, units)):
            found[name] = Column(unit, self.torque[:, i])
            for end, values in (("low", self.low), ("high", self.high)):
                if values is not None:
                    found[f"{name}.{end}"] = Column(unit, values[:, i])
        shares = zip(self.residual, self.share.T)
        return found | {f"residual.{name}": Column("1", x) for name, x in shares}

    def __getitem__(self, name: str) -> Array:
        """Return a column (n,)."""
        columns = self.columns()
        known("moments", "", "column", name, columns)
        return columns[name]

    def to_csv(self, path: str | Path | None = None, /) -> str:
        """Return the columns as CSV text with units, and write it to a path if one is given."""
        return to_csv(self._columns(), path)

    def plot(self, *names: str) -> Any:
        """A matplotlib figure of torques with their bands. Raises MissingPackage."""
        chosen = names or self.names
        figure, panels = needed("matplotlib.pyplot", "plot").subplots(
            len(chosen), 1, squeeze=False, sharex=True
        )
        for name, panel in zip(chosen, panels[:, 0]):
            panel.plot(self.t, self[name])
            if self.low is not None:
                panel.fill_between(self.t, self[f"{name}.low"], self[f"{name}.high"], alpha=1 / 4)
            panel.set(ylabel=name)
        return figure


@explained
def joint_moments(
    mechanism: Model | Mechanism,
    fit: Tracking | Trial,
    *,
    plates: str | Mapping[str, str] = "auto",
    cutoff: float | None = None,
    order: int = 3,
    band: bool = False,
    actuated: Sequence[str] | None = None,
    progress: Progress = None,
) -> Moments:
    """Compute the joint moments of a motion, with the forces of its plates.

    Parameters
    ----------
    mechanism : Model or Mechanism
        The model that was tracked, in one piece or with closed loops.
    fit : Tracking or Trial
        The motion: of `pg.track`, or of a trial with columns of coordinates.
    plates : "auto" or dict
        Bodies that plates bear, {"plate 1": "foot_r", "plate 2": "auto"}. By default, "auto", each
        loaded spell of a plate belongs to the body whose sites, or tip, are nearest to the centre
        of pressure meanwhile. Plates that a dict does not name bear nobody.
    cutoff : float, optional
        Cut-off frequency of the filter [Hz], by default 6 Hz; float("inf") for none. A smoothed
        motion is not filtered by default.
    order : int
        Order of the filter, which acts forward and backward.
    band : bool
        Whether to compute the 95 % band of the moments of the motion itself, by the errors of
        markers that residuals show. Filtered moments outside of it have lost part of the motion.
    actuated : sequence of str, optional
        With closed loops, names of the bodies whose joints have torques. By default, all.
    progress : callable, optional
        Function of the completed fraction. If it returns False, the call stops with a
        PgraphError.

    Returns
    -------
    Moments
        `torque`, the band `low` and `high`, `share` of the residual in the weight.

    Raises
    ------
    InputError
        If the motion is too short for the filter, or an argument is invalid.

    Examples
    --------
        loads = pg.joint_moments(model, fit, plates={"plate 1": "foot_r"}, cutoff=6, band=True)
        loads.to_csv("id.csv")
    """
    mech = mechanism_of(mechanism, "joint_moments")
    trial = fit.trial if isinstance(fit, Tracking) else fit
    if not isinstance(trial, Trial):
        raise wrong_type("joint_moments", "fit", "of pg.track or a pg.Trial", fit)
    q = fit.q if isinstance(fit, Tracking) else trial.with_up(mech.model.up).positions(mech)
    if q.shape != (len(trial.t), mech.nq):
        text = f"has {q.shape[1]} coordinates, and the model {mech.nq}: is it of this model?"
        raise refusal("joint_moments", "fit", text)
    if band and (not isinstance(fit, Tracking) or len(mech.packed.active)):
        text = "needs a motion of pg.track, of a model without closed loops"
        raise refusal("joint_moments", "band", f"{text}; give band=False")
    own = fit if isinstance(fit, Tracking) else None
    smooth = own is not None and own.v is not None
    frequency = checked(cutoff, order, smooth)
    t, report = trial.t, list[str]()
    if np.isinf(frequency) and own and own.v is not None and own.vdot is not None:
        sampled = Sampled(q, own.v, own.vdot)
    else:
        sampled = moved(mech, t, q, frequency, order)
    if np.isfinite(frequency) and len(t) // 2 < (len(t) - 1) / (t[-1] - t[0]) / frequency:
        report.append("the trial is shorter than two periods of the cut-off frequency, so that "
                      "its ends are in doubt")  # fmt: skip
    tell(progress, 1 / 4)
    whose = _borne(mech, trial.with_up(mech.model.up), sampled.x, plates, report)
    loads = _Loads(mech, t, trial.with_up(mech.model.up).plates, whose)
    tau = loads.torques(sampled)
    if len(mech.packed.active):
        sampled, tau = _in_loops(mech, loads, sampled, actuated)
    elif actuated is not None:
        text = "is for closed loops; every joint of a tree has the torque that it needs"
        raise refusal("joint_moments", "actuated", text)
    tell(progress, 1 / 2)
    low, high, names, root = None, None, _names(mech), _root(mech)
    if band and own:
        low, high = band_of(mech, own if own.v is None else followed(own), loads.torques, progress)
        report += _outside(names, tau, low, high)
    tell(progress, 1.0)
    weight = sum(b.mass for b in mech.model.bodies) * float(np.linalg.norm(mech.model.gravity))
    arm = np.where(mech.packed.slides, 1.0, mech.packed.length)[root]
    share = tau[:, root] / (arm * weight) if weight else np.zeros((len(t), len(root)))
    return Moments(
        mech, t, *sampled, tau, names, low, high, loads.external(sampled.x),
        tuple(names[i] for i in root), share, loads.told(sampled.x), tuple(report),
    )  # fmt: skip


def _outside(names: Sequence[str], tau: Array, low: Array, high: Array) -> list[str]:
    """Return a sentence on moments that are outside of their band in more than 5 % of frames."""
    share = ((tau < low) | (tau > high)).mean(axis=0)
    found = [f"{name} in {percent(x)}" for name, x in zip(names, share) if x > 1 / 20]
    if not found:
        return []
    return [f"the filter takes part of the motion or leaves noise, outside of the band: "
            f"{choices(found, 12)} of frames; smooth=True of pg.track needs no filter"]  # fmt: skip


def _names(mech: Mechanism) -> tuple[str, ...]:
    """Return a name for each velocity: of an output of its coordinate, or of its joint."""
    positions, speeds = coordinates(mech)
    of_q, of_v = plan(mech.packed).plain
    of_outputs = {}
    for o in mech.model.outputs:
        if o.kind == "joint_position" and o.at in mech.joints:
            j = mech.joints[o.at]
            if j.q.stop - j.q.start == j.v.stop - j.v.start:
                of_outputs[j.v.start + o.coordinate] = o.name
    return tuple(of_outputs.get(i, name) for i, (name, _) in enumerate(speeds))


def _root(mech: Mechanism) -> list[int]:
    """Return the velocities of joints to the ground that can move along, so that nothing drives
    them."""
    found = []
    for name, joint in mech.joints.items():
        to_ground = mech.topology.parent[mech.topology.number(name) - 1] == 0
        several = joint.v.stop - joint.v.start > 2
        if to_ground and several and mech.packed.slides[joint.v].any():
            found += range(joint.v.start, joint.v.stop)
    return found


# -- plates ----------------------------------------------------------------------------------------


@dataclass
class _Loads:
    """The plates' wrenches on bodies."""

    mech: Mechanism
    t: Array
    plates: tuple[Plate, ...]
    whose: dict[str, Array]  # {plate: (n,)} index of the body in each frame, -1 without load

    def __post_init__(self) -> None:
        self.wrench = {p.name: p.wrench(self.t) for p in self.plates if p.name in self.whose}

    def external(self, q: Array) -> Array:
        """Return the loads (n, nb, 6) at the bodies' origins."""
        n, nv = len(q), self.mech.nv
        found = np.zeros((n, self.mech.nb, 6))
        if not self.wrench:
            return found
        none = np.zeros((n, nv))
        place = motions(self.mech.packed, q, none, none).place
        for name, wrench in self.wrench.items():
            body = np.tile(self.whose[name], n // len(self.t))
            k = np.flatnonzero(body >= 0)
            wrench = np.tile(wrench, (n // len(self.t), 1))[k]
            at = place[k, body[k]]
            found[k, body[k], :3] += wrench[:, :3] - np.cross(at, wrench[:, 3:])
            found[k, body[k], 3:] += wrench[:, 3:]
        return found

    def torques(self, sampled: Sampled) -> Array:
        """Return the torques (n, nv) of the tree."""
        return torques(self.mech, *sampled, self.external(sampled.x))

    def told(self, q: Array) -> dict[str, tuple[tuple[str, float, float, float], ...]]:
        """Return which plate bears which body, when, and how far from it."""
        found = {}
        by_name = {p.name: p for p in self.plates}
        for name, body in self.whose.items():
            apart, spells = _distances(self.mech, self.t, q, by_name[name]), []
            for spell in _spells(np.where(np.isfinite(apart).any(axis=1), body, -1)):
                b = int(body[spell[0]])
                far = (
                    float(np.nanmean(apart[spell, b]))
                    if np.isfinite(apart[spell, b]).any()
                    else 0.0
                )
                spells.append((self.mech.names[b], float(self.t[spell[0]]),
                               float(self.t[spell[-1]]), far))  # fmt: skip
            found[name] = tuple(spells)
        return found


def _spells(body: Array) -> list[Array]:
    """Return the frames of each spell with one body."""
    cuts = np.flatnonzero(np.diff(body)) + 1
    parts = np.split(np.arange(len(body)), cuts)
    return [part for part in parts if len(part) and body[part[0]] >= 0]


def _distances(mech: Mechanism, t: Array, q: Array, plate: Plate) -> Array:
    """Return the distances (n, nb) of the centre of pressure from the nearest point of each body,
    inf for bodies without a site or a tip, and nan without a load."""
    none = np.zeros((len(q), mech.nv))
    found = motions(mech.packed, q, none, none)
    where = np.stack(
        [np.interp(t, plate.t[plate.loaded], x) for x in plate.point[plate.loaded].T], 1
    )
    borne = np.interp(t, plate.t, plate.loaded.astype(float), 0.0, 0.0) >= 1 / 2
    apart = np.full((len(t), mech.nb), np.inf)
    points = [(mech.topology.number(s.body) - 1, s.point) for s in mech.model.sites]
    points += [(int(tip) - 1, mech.model.body(mech.names[tip - 1]).tip_point) for tip in mech.tips]
    for b, point in points:
        if b >= 0:
            at = found.place[:, b] + found.turn[:, b] @ np.array(point)
            apart[:, b] = np.minimum(apart[:, b], np.linalg.norm(at - where, axis=1))
    return np.where(borne[:, None], apart, np.nan)


def _borne(
    mech: Mechanism, trial: Trial, q: Array, plates: Any, report: list[str]
) -> dict[str, Array]:
    """Return the index of the body that each plate bears in each frame, -1 without load."""
    there = {p.name: p for p in trial.plates}
    given = dict.fromkeys(there, AUTO) if plates == AUTO else plates
    if not isinstance(given, Mapping):
        text = f"must be 'auto' or a dict such as {{'plate 1': 'foot_r'}}, got {shown(plates)}"
        raise refusal("joint_moments", "plates", text)
    for name, body in given.items():
        known("joint_moments", "plates", "plate", name, there)
        if body != AUTO:
            known("joint_moments", "plates", f"body of {name!r}", body, mech.names)
    if not there:
        report.append("no force plates: the root bears all")
    found: dict[str, Array] = {}
    for name, plate in there.items():
        if (body := given.get(name)) is None:
            report.append(f"{name} is given no body, and left out")
            continue
        if body != AUTO:
            number = mech.topology.number(body) - 1
            found[name] = np.full(len(trial.t), number)
            continue
        found[name] = of = np.full(len(trial.t), -1)
        if not plate.loaded.any():
            continue
        apart = _distances(mech, trial.t, q, plate)
        push = np.linalg.norm(plate.wrench(trial.t)[:, 3:], axis=1)
        for spell in _spells(np.where(np.isfinite(apart).any(axis=1), 0, -1)):
            mean = push[spell] @ np.where(np.isfinite(apart[spell]), apart[spell], np.inf)
            of[spell] = best = int(np.argmin(mean))
            nearest = np.nanargmin(apart[spell], axis=1)
            for b in {int(b) for b in nearest} - {best}:
                share = push[spell][nearest == b].sum() / push[spell].sum()
                if share > 1 / 4 and _rigid(mech, b) != _rigid(mech, best):
                    names = f"{mech.names[b]} as well as {mech.names[best]}"
                    start = float(trial.t[spell[0]])
                    report.append(f"{name} perhaps bears {names}, from {start:.3g} s")
        spread = np.flatnonzero(of >= 0)  # below the threshold, the last or next body bears it
        if len(spread):
            nearest = spread[np.abs(np.arange(len(of))[:, None] - spread).argmin(axis=1)]
            found[name] = of[nearest]
    return found


def _rigid(mech: Mechanism, b: int) -> int:
    """Return the first body that moves as this one does."""
    moves = plan(mech.packed).carried
    return int(np.flatnonzero((moves == moves[b]).all(axis=1))[0])


# -- closed loops ----------------------------------------------------------------------------------


def _in_loops(
    mech: Mechanism, loads: _Loads, sampled: Sampled, actuated: Sequence[str] | None
) -> tuple[Sampled, Array]:
    """Return the nearest motion that loops permit, and its torques of least norm.

    With N the permitted velocities, Nᵀ τ = Nᵀ r, as in `constrained_inverse_dynamics` with
    `nearest=True`.
    """
    chosen = np.arange(mech.nv)
    if actuated is not None:
        for name in actuated:
            known("joint_moments", "actuated", "joint that moves", name, mech.joints)
        spans = [mech.joints[name].v for name in actuated]
        chosen = np.unique(np.concatenate([np.arange(s.start, s.stop) for s in spans]))
    base, states, ways = Rows.of(mech, mech.packed.active, sampled.x[0]), [], []
    for q, v, a in zip(*sampled):
        q, v, _ = mech.assemble(q, v)
        a, _ = mech._constrained_acceleration(q, v, mech._tree_torque(q, v, a))
        ways.append(complement(judged(rows := base.at(q, v))[0], mech.nv))
        ways[-1] = rows.step(ways[-1])
        states.append((q, v, a))
    sampled = Sampled(*(np.array(x) for x in zip(*states)))
    force = loads.torques(sampled)
    tau = np.zeros_like(force)
    for k, free in enumerate(ways):
        tau[k, chosen] = np.linalg.lstsq(free[chosen].T, free.T @ force[k], rcond=None)[0]
        left = np.abs(free.T @ (force[k] - tau[k])).max(initial=0.0)
        if left > NOTABLE * np.abs(free.T @ force[k]).max(initial=0.0):
            text = f"the torques of {choices(actuated or mech.joints, 6)} cannot move the loops at "
            text += f"t = {loads.t[k]:g} s; name more joints"
            raise refusal("joint_moments", "actuated", text)
    return sampled, tau

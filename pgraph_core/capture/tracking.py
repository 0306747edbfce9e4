"""Marker tracking: the positions of a mechanism that are closest to the markers of a trial.

Each frame is a least-squares problem, Σ w |x(q) - x̂|², within limits and closed loops (Lu and
O'Connor, J. Biomechanics 32 (1999) 129-134). All frames are solved at once by damped Gauss-Newton
steps, each from the solution of a frame nearby. A coordinate at its limit is held there as long as
its gradient points beyond it.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.inverse import bounds
from ..analysis.rows import Rows, apart, turns
from ..dynamics.many import Twists, plan, twists
from ..errors import (
    InputError,
    PgraphError,
    Problem,
    choices,
    counted,
    explained,
    nearest_name,
    shown,
)
from ..mechanism import Mechanism, mechanism_of
from ..model import Model
from ..model.files import write_atomic
from ..result.columns import Column, coordinates
from ..tolerances import (
    EPS,
    FAINT,
    LONGEST_STEP,
    NAMED,
    NOTABLE,
    PROXIMAL,
    ROUNDING,
    SOLVED,
    SUFFICIENT_DECREASE,
)
from .trial import Array, Trial

BLOCK = 16  # frames that start from the same solution
STARTS = 40  # positions from which the first frame is solved
PROMISING = 8  # steps after which the best of as many are pursued
ROUNDS = 200  # steps at most
CLOSING = 20  # steps that close loops
GRADIENT = SOLVED / 10  # slope below which a frame is solved, relative to lengths

Progress = Callable[[float], Any] | None


class Stopped(PgraphError):
    """A progress function has returned False, which stops the call."""


def tell(progress: Progress, fraction: float) -> None:
    """Report a completed fraction. Raises Stopped if the function returns False."""
    if progress is not None and progress(fraction) is False:
        raise Stopped(
            Problem("progress", "", "the call was stopped, as its function returned False")
        )


@explained
@dataclass(frozen=True, eq=False)
class Tracking:
    """The motion of a mechanism that follows the markers of a trial.

    `print(fit)` tells how well it does, and what the markers do not determine.
    """

    mechanism: Mechanism
    trial: Trial  # in the axes of the model
    t: Array  # (n,) [s]
    q: Array  # (n, nq)
    markers: tuple[str, ...]  # sites that are followed
    offset: Array  # (n, m, 3) sites minus markers [m], nan where not seen
    weights: Array  # (m,)
    gradient: Array  # (n,) largest remaining slope of the rms distance, relative to lengths
    v: Array | None = None  # (n, nv) of a smoothed motion
    vdot: Array | None = None  # (n, nv)
    smooth: float | None = None  # weight of the squares of q''' [s^6]
    undetermined: tuple[str, ...] = ()
    report: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    """(n, nv, nv) of the positions of each frame, for independent errors of the markers."""

    @property
    def residual(self) -> Array:
        """The distances (n, m) of markers from their sites [m], nan where not seen."""
        return np.linalg.norm(self.offset, axis=2)

    @property
    def cost(self) -> Array:
        """The weighted sums of squares (n,) [m^2]."""
        return np.nansum(self.weights * self.residual**2, axis=1)

    @property
    def rms(self) -> Array:
        """The root mean square of the distances of each frame, (n,) [m]."""
        seen = np.maximum(np.isfinite(self.residual).sum(axis=1), 1)
        return np.sqrt(np.nansum(self.residual**2, axis=1) / seen)

    def __repr__(self) -> str:
        total = float(np.sqrt(np.nanmean(self.residual**2))) if self.residual.size else 0.0
        head = f"<Tracking: {counted(len(self.t), 'frame')}, {counted(len(self.markers), 'marker')}"
        head += f", rms {1000 * total:.3g} mm"
        by_marker = np.sqrt(
            np.nanmean(np.where(self._seen.any(0), self.residual, 0.0) ** 2, axis=0)
        )
        worst = np.argsort(-by_marker)[:3]
        parts = [f"{self.markers[i]} {1000 * by_marker[i]:.3g} mm" for i in worst]
        lines = [head, f"largest rms: {', '.join(parts)}", *self.undetermined, *self.report]
        return "\n  ".join(lines) + ">"

    @property
    def _seen(self) -> Array:
        return np.isfinite(self.residual)

    def columns(self) -> dict[str, Array]:
        """Return t, the coordinates, outputs of joint positions and residuals as {name: (n,)}."""
        return {name: column.values for name, column in self._columns().items()}

    def _columns(self) -> dict[str, Column]:
        positions, speeds = coordinates(self.mechanism)
        found = {"t": Column("s", self.t)}
        found |= {name: Column(unit, x) for (name, unit), x in zip(positions, self.q.T)}
        for kind, per, x in (("v", "/s", self.v), ("vdot", "/s^2", self.vdot)):
            if x is not None:
                found |= {f"{kind}.{n}": Column(u + per, y) for (n, u), y in zip(speeds, x.T)}
        found |= {f"residual.{x}": Column("m", y) for x, y in zip(self.markers, self.residual.T)}
        return found

    def to_csv(self, path: str | Path | None = None, /) -> str:
        """Return the columns as CSV text with units, and write it to a path if one is given."""
        return to_csv(self._columns(), path)

    def motion(self, joint: str) -> Any:
        """Return a prescribed motion of a joint with one coordinate, for a run that follows it.

        Raises InputError if the joint has several.
        """
        from ..model import Motion, Table

        spans = {name: j.q for name, j in self.mechanism.joints.items()}
        if joint not in spans or spans[joint].stop != spans[joint].start + 1:
            text = f"needs a joint with one coordinate; {nearest_name(joint, spans)}"
            raise InputError(Problem("motion", "joint", f"{shown(joint)} {text}"))
        values = self.q[:, spans[joint].start]
        table = Table(t=tuple((self.t - self.t[0]).tolist()), value=tuple(values.tolist()))
        return Motion(name=f"{joint} tracked", body=joint, q_of_t=table)


def to_csv(columns: Mapping[str, Column], path: str | Path | None) -> str:
    """Return columns as CSV text with units in the header, and write it to a path."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(f"{name} [{c.unit}]" if c.unit else name for name, c in columns.items())
    rows = zip(*(c.values.tolist() for c in columns.values()))
    writer.writerows(["" if x != x else x for x in row] for row in rows)
    if path is not None:
        write_atomic(path, text.getvalue())
    return text.getvalue()


@explained
def track(
    mechanism: Model | Mechanism,
    trial: Trial,
    *,
    weights: Mapping[str, float] | None = None,
    markers: Mapping[str, str] | None = None,
    smooth: float | bool | None = None,
    q: Any = None,
    progress: Progress = None,
) -> Tracking:
    """Find the motion of a mechanism that follows the markers of a trial.

    Each marker belongs to the site of its name. In each frame, the weighted sum of squares of their
    distances is least, within limits and closed loops, to a gradient of 1e-10 or less. Markers that
    are not seen in a frame have no weight in it.

    Parameters
    ----------
    mechanism : Model or Mechanism
        A model with sites.
    trial : Trial
        Markers, as of `pg.read_trial`.
    weights : dict, optional
        Weights by name of site, by default 1. Sites of weight 0 are not followed.
    markers : dict, optional
        Labels by name of site, {"RHeel": "RHEE"}, of markers with other names.
    smooth : float or True, optional
        Fit all frames at once with this weight [s^6] of the squares of q''', in which rotations
        count with the span of the markers. This also gives v and v'. True chooses the weight by
        generalised cross-validation. By default, each frame is fitted alone.
    q : array or dict, optional
        Position from which the first frame is also searched, by default the initial one.
    progress : callable, optional
        Function of the completed fraction. If it returns False, the call stops with a
        PgraphError.

    Returns
    -------
    Tracking
        `q`, `residual`, `rms`, and what the markers do not determine.

    Raises
    ------
    InputError
        If no marker belongs to a site, or an argument is invalid.

    Examples
    --------
        fit = pg.track(model, pg.read_trial("walk.trc"), weights={"RHeel": 3})
        fit.to_csv("ik.csv")
    """
    mech = mechanism_of(mechanism, "track")
    if not (smooth is None or (isinstance(smooth, (bool, float, int)) and smooth >= 0)):
        text = f"must be a number >= 0 [s^6], or True to choose it, got {shown(smooth)}"
        raise InputError(Problem("track", "smooth", text))
    problem = Markers.of(mech, trial, weights, markers)
    v = vdot = chosen = None
    found = problem.solved(mech.assemble(q)[0], progress)
    if smooth is not None and smooth is not False:
        from .smoothing import smoothed

        found, v, vdot, chosen = smoothed(problem, found, smooth)
    tell(progress, 1.0)
    return problem.answer(found, v, vdot, chosen)


@dataclass
class Markers:
    """The markers of a trial and the sites that they belong to."""

    mech: Mechanism
    trial: Trial
    names: tuple[str, ...]
    body: Array  # (m,) index of the site's body, -1 of the ground
    point: Array  # (m, 3) [m]
    place: Array  # (n, m, 3) of the markers [m], nan where not seen
    weight: Array  # (m,)
    report: list[str]

    def __post_init__(self) -> None:
        mech = self.mech
        self.low, self.high = bounds(mech)
        made = plan(mech.packed)
        self.moving = made.carried[self.body] * (self.body >= 0)[:, None]
        self.before = made.carried[made.own].T.copy()  # 1.0 where one coordinate carries another
        self.of_q, self.of_v = made.plain
        self.hinges = np.zeros(mech.nv, dtype=bool)  # that are back after a turn
        for name, joint in mech.joints.items():
            motions = mech.model.body(name).sequence
            self.before[joint.v, joint.v] = _before([m.kind for m in motions])
            if joint.v.stop - joint.v.start == len(motions):
                self.hinges[joint.v] = [m.facts.pivots for m in motions]
        seen = self.place[np.isfinite(self.place[..., 0])]
        self.size = float(np.ptp(self.point, axis=0).max() + np.ptp(seen, axis=0).max()) or 1.0
        self.scale = np.where(turns(mech), 1.0, self.size)
        self.rows = Rows.of(mech, mech.packed.active, mech.home()[0])

    @classmethod
    def of(
        cls,
        mech: Mechanism,
        trial: Trial,
        weights: Mapping[str, float] | None,
        labels: Mapping[str, str] | None,
    ) -> Markers:
        """Match labels and sites. Raises InputError."""
        if not isinstance(trial, Trial):
            text = f"must be a trial, as of pg.read_trial(path), got {shown(trial)}"
            raise InputError(Problem("track", "trial", text))
        up = mech.model.up.lstrip("+-")
        trial = trial.with_up(up) if up in ("x", "y", "z") else trial
        sites = {s.name: s for s in mech.model.sites}
        weights, labels = dict(weights or {}), dict(labels or {})
        for name in (*weights, *labels):
            if name not in sites:
                text = f"there is no site {name!r}; {nearest_name(name, sites)}"
                raise InputError(
                    Problem("track", "weights" if name in weights else "markers", text)
                )
        for name, label in labels.items():
            if label not in trial.markers:
                text = f"{label!r} of site {name!r} is no marker of the trial; "
                text += nearest_name(str(label), trial.markers)
                raise InputError(Problem("track", "markers", text))
        for name, weight in weights.items():
            if not (isinstance(weight, (int, float)) and 0.0 <= weight < np.inf):
                text = f"the weight of {name!r} must be a number >= 0, got {shown(weight)}"
                raise InputError(Problem("track", "weights", text))
        label_of = {name: labels.get(name, name) for name in sites}
        seen = {x for x, m in trial.markers.items() if np.isfinite(m).any()}
        used = [x for x in sites if label_of[x] in seen and weights.get(x, 1.0) > 0.0]
        if not used:
            have = choices(trial.markers, 12) or "none"
            text = f"has no marker with the name of a site; its markers are {have}, and the sites "
            text += f"{choices(sites, 12) or 'none'}; markers={{'SITE': 'LABEL'}} matches them"
            raise InputError(Problem("track", "trial", text))
        report = list(trial.report)
        if lost := [x for x in sites if label_of[x] not in seen and weights.get(x, 1.0) > 0.0]:
            report.append(f"sites without a marker: {choices(lost, 12)}")
        if spare := [x for x in trial.markers if x not in {label_of[s] for s in used}]:
            report.append(f"markers without a site: {choices(spare, 12)}")
        number, place = (
            mech.topology.number,
            np.stack([trial.markers[label_of[x]] for x in used], 1),
        )
        home = mech.pose(mech.home()[0])
        wide = float(np.linalg.norm(np.ptp([home[x].position for x in used], axis=0)))
        shown_at = place[np.isfinite(place[..., 0]).sum(axis=1).argmax()]
        span = float(np.linalg.norm(np.nanmax(shown_at, axis=0) - np.nanmin(shown_at, axis=0)))
        if not NAMED * wide <= span <= wide / NAMED:
            report.append(f"markers span {span:.3g} m in a frame, and their sites {wide:.3g} m: is "
                          "the unit right? units='mm' of pg.read_trial changes it")  # fmt: skip
        return cls(
            mech, trial, tuple(used),
            np.array([number(sites[x].body) - 1 for x in used]),
            np.array([sites[x].point for x in used], float),
            place,
            np.array([float(weights.get(x, 1.0)) for x in used]), report,
        )  # fmt: skip

    # -- the problem at positions ----------------------------------------------------------------

    def points(self, q: Array) -> tuple[Twists, Array, Array]:
        """Return the twists at positions, the places (n, m, 3) of sites, and their Jacobians."""
        found = twists(self.mech.packed, q)
        return found, *found.points(self.body, self.point, self.moving)

    def normal(self, q: Array, frames: Array) -> tuple[Array, Array, Array, Array]:
        """Return costs (n,), gradients (n, nv), H (n, nv, nv) and the rest of their Hessian.

        The rest is Σ w off x'', in which a coordinate turns the paths of those that it carries. It
        lacks what the motions of curves bend.
        """
        found, place, slope = self.points(q)
        off = place - self.place[frames]
        weight = np.where(np.isfinite(off[..., 0]), self.weight, 0.0)[..., None]
        off = np.where(weight > 0.0, off, 0.0)
        pull = weight * off
        n, m, _, nv = slope.shape
        rows = (np.sqrt(weight)[..., None] * slope).reshape(n, 3 * m, nv)
        g = (pull.reshape(n, 1, 3 * m) @ slope.reshape(n, 3 * m, nv))[:, 0]
        torque = np.empty((n, 3, nv))  # Σ w x' x off
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            torque[:, i] = np.einsum("nmv,nm->nv", slope[:, :, j], pull[..., k])
            torque[:, i] -= np.einsum("nmv,nm->nv", slope[:, :, k], pull[..., j])
        bent = (found.twist[..., :3] @ torque) * self.before
        rest = bent + bent.transpose(0, 2, 1)
        rest[:, range(nv), range(nv)] /= 2
        return (pull * off).sum(axis=(1, 2)), g, rows.transpose(0, 2, 1) @ rows, rest

    def loops(self, q: Array) -> tuple[Array, Array]:
        """Return the gaps (n, k) [m] and rows (n, k, nv) of loops, k = 0 for a tree."""
        packed, n = self.mech.packed, len(q)
        if not len(packed.active):
            return np.zeros((n, 0)), np.zeros((n, 0, packed.nv))
        rows = [self.rows.at(x) for x in q]
        held = [r.holonomic for r in rows]
        return (np.array([r.gap[h] for r, h in zip(rows, held)]),
                np.array([r.J[h] for r, h in zip(rows, held)]))  # fmt: skip

    def free(self, q: Array, g: Array) -> Array:
        """Return projections (n, nv, nv) onto the directions that loops and limits leave.

        A coordinate at a limit is held if its gradient, without forces of loops, points beyond it.
        """
        rows, here, edge = self.loops(q)[1], self._single(q), NOTABLE * self.scale
        below, above = here <= self.low + edge, here >= self.high - edge
        held = below | above
        if held.any():
            left = np.where(held[:, None], 0.0, rows)
            pull = np.where(held, 0.0, g)[..., None]
            force = np.linalg.pinv(left, rcond=NOTABLE).transpose(0, 2, 1) @ pull
            slope = g - (rows.transpose(0, 2, 1) @ force)[..., 0]
            held = (below & (slope >= 0.0)) | (above & (slope <= 0.0))
        keep = np.eye(self.mech.nv) * ~held[:, None]
        if not rows.shape[1]:
            return keep
        left = np.where(held[:, None], 0.0, rows)
        return keep - np.linalg.pinv(left, rcond=NOTABLE) @ left

    def moved(self, q: Array, step: Array) -> Array:
        """Return positions after displacements (n, nv), within limits, with loops closed."""
        q = self._clipped(advanced(self.mech, q, step))
        if not len(self.mech.packed.active):
            return q
        left = np.arange(len(q))
        for _ in range(CLOSING):
            gap, rows = self.loops(q[left])
            still = np.abs(gap).max(axis=1, initial=0.0) > ROUNDING * self.size
            left, gap, rows = left[still], gap[still], rows[still]
            if not len(left):
                break
            here = self._single(q[left])
            held = (here <= self.low) | (here >= self.high)
            rows = np.where(held[:, None], 0.0, rows)
            close = np.linalg.pinv(rows, rcond=NOTABLE) @ gap[..., None]
            q[left] = self._clipped(advanced(self.mech, q[left], -close[..., 0]))
        return q

    def _single(self, q: Array) -> Array:
        """Return the coordinates (n, nv) that limits can have, 0 for attitudes."""
        found = np.zeros((len(q), self.mech.nv))
        found[:, self.of_v] = q[:, self.of_q]
        return found

    def _clipped(self, q: Array) -> Array:
        low, high = self.low[self.of_v], self.high[self.of_v]
        q[:, self.of_q] = np.clip(q[:, self.of_q], low, high)
        return q

    # -- the search ------------------------------------------------------------------------------

    def descended(self, q: Array, frames: Array, rounds: int = ROUNDS) -> tuple[Array, Array]:
        """Return positions (n, nq) of least cost near q, and their costs.

        A Gauss-Newton step that is short is replaced by that of Newton.
        """
        q = self.moved(q, np.zeros((len(q), self.mech.nv)))
        cost, g, H, rest = self.normal(q, frames)
        damping, live, one = np.zeros(len(q)), np.arange(len(q)), np.eye(self.mech.nv)
        for _ in range(rounds):
            P = self.free(q[live], g[live])
            going = self._slope(P, g[live], H[live]) > ROUNDING * self.size
            live, P = live[going], P[going]
            if not len(live):
                break
            down = -(P @ g[live][..., None])
            width = np.einsum("nii->ni", H[live])
            width = np.where(width > 0.0, width, 1.0)
            base = (one - P) * width[..., None]
            base += one * ((damping[live, None] + PROXIMAL) * width)[:, None]
            step = self._step(P, H[live], base, down)
            reach = np.abs(step / self.scale).max(axis=1) / LONGEST_STEP
            near = np.flatnonzero((reach < NAMED) & (damping[live] == 0.0))
            full = (H + rest)[live[near]]
            step[near] = self._step(P[near], full, base[near], down[near])
            step /= np.maximum(reach, 1.0)[:, None]
            trial = self.moved(q[live], step)
            new = self.normal(trial, frames[live])
            promised = (down[..., 0] * step).sum(axis=1)
            change = new[0] - cost[live]
            better = change <= ROUNDING * cost[live] - SUFFICIENT_DECREASE * promised
            better &= promised > 0.0
            taken = live[better]
            for old, now in zip((q, cost, g, H, rest), (trial, *new)):
                old[taken] = now[better]
            less = np.where(damping[live] < FAINT, 0.0, damping[live] / 10)
            damping[live] = np.where(better, less, np.maximum(10 * damping[live], FAINT))
            live = live[damping[live] < 1 / SOLVED]
        return q, cost

    def _step(self, P: Array, H: Array, base: Array, down: Array) -> Array:
        return (P @ np.linalg.solve(P @ H @ P + base, down))[..., 0]

    def _slope(self, P: Array, g: Array, H: Array) -> Array:
        """Return the largest slopes (n,) of the root of the cost, each per path of markers [m]."""
        width = np.sqrt(np.einsum("nii->ni", H))
        slope = (P @ g[..., None])[..., 0] / np.where(width > 0.0, width, 1.0)
        return np.abs(slope).max(axis=1, initial=0.0) / np.sqrt(self.weight.sum())

    def solved(self, start: Array, progress: Progress = None) -> Array:
        """Return the positions (n, nq) of all frames."""
        n = len(self.place)
        first = int(np.isfinite(self.place[..., 0]).sum(axis=1).argmax())
        found = np.tile(start, (n, 1))
        found[first] = self._first(start, first)
        for part in (range(first + 1, n), range(first - 1, -1, -1)):
            last = first
            for begin in range(0, len(part), BLOCK):
                block = np.array(part[begin : begin + BLOCK])
                found[block] = self.descended(np.tile(found[last], (len(block), 1)), block)[0]
                last = int(block[-1])
                tell(progress, abs(last - first) / n)
        return self._without_jumps(found)

    def _first(self, start: Array, frame: int) -> Array:
        """Return the position of a frame that is nearest to the start of those of least cost.

        Several starts are tried. Costs that differ by a tenth are alike.
        """
        random = np.random.default_rng(0)
        step = random.normal(size=(STARTS, self.mech.nv)) * self.scale
        step[0] = 0.0
        starts = advanced(self.mech, np.tile(start, (STARTS, 1)), step)
        q, cost = self.descended(starts, np.full(STARTS, frame), PROMISING)
        best = np.union1d(np.argsort(cost)[: STARTS // PROMISING], 0)
        q, cost = self.descended(q[best], np.full(len(best), frame))
        good = np.flatnonzero(cost <= (1 + NAMED) * cost.min() + EPS)
        away = [np.linalg.norm(self._apart(start, q[k])) for k in good]
        chosen = q[good[int(np.argmin(away))]]
        endless = self.hinges & np.isinf(self.low) & np.isinf(self.high)
        i = self.of_q[endless[self.of_v]]
        chosen[i] -= 2 * np.pi * np.round((chosen[i] - start[i]) / (2 * np.pi))
        return chosen

    def _without_jumps(self, q: Array) -> Array:
        """Solve frames beside a jump from each other, and keep what is as good."""
        n, cost = len(q), self.normal(q, np.arange(len(q)))[0]
        for order in (range(1, n), range(n - 2, -1, -1)):
            for k in order:
                before = q[k - order.step]
                if self._far(before, q[k]).any():
                    new, value = self.descended(before[None].copy(), np.array([k]))
                    if value[0] <= (1 + NOTABLE) * cost[k] + EPS:
                        q[k], cost[k] = new[0], value[0]
        return q

    def _apart(self, one: Array, other: Array) -> Array:
        return np.abs(apart(self.mech, one, other)) / self.scale

    def _far(self, one: Array, other: Array) -> Array:
        """Return the velocities (nv,) that jump between two positions."""
        if np.abs(other - one).max(initial=0.0) < min(1.0, self.size) * LONGEST_STEP / 4:
            return np.zeros(self.mech.nv, dtype=bool)  # numbers of a turn are half of its angle
        return self._apart(one, other) > LONGEST_STEP

    # -- the answer ------------------------------------------------------------------------------

    def answer(self, q: Array, v: Any, vdot: Any, smooth: float | None) -> Tracking:
        """Return the result, with what the markers do not determine and what is odd."""
        cost, g, H, _ = self.normal(q, np.arange(len(q)))
        off = self.points(q)[1] - self.place
        P = self.free(q, g)
        slope = self._slope(P, g, H)
        seen = np.isfinite(self.place[..., 0])
        residual = np.linalg.norm(off, axis=2)
        freedom = 3 * int(seen.sum()) - float(np.einsum("nii->", P))
        covariance = np.linalg.pinv(P @ H @ P, rcond=SOLVED, hermitian=True)
        covariance *= float(cost.sum()) / max(freedom, 1.0)
        report = [*self.report, *self._doubts(q, residual, slope, smooth)]
        return Tracking(
            self.mech, self.trial, self.trial.t, q, self.names, off, self.weight, slope,
            v, vdot, smooth, tuple(self._undetermined(H, P)), tuple(report), covariance,
        )  # fmt: skip

    def _undetermined(self, H: Array, P: Array) -> list[str]:
        """Return a sentence on the directions of motion that no marker shows in any frame."""
        listed = [name for name, _ in coordinates(self.mech)[1]]
        units = self.scale[:, None] * self.scale / self.size**2
        shown_ways = (P @ H @ P).sum(axis=0) * units / (self.weight.sum() * len(H))
        sizes, ways = np.linalg.eigh(shown_ways + np.eye(len(units)) - P.mean(axis=0))
        lost = ways[:, sizes <= SOLVED]
        if not lost.shape[1]:
            return []
        names = [x for x, part in zip(listed, np.linalg.norm(lost, axis=1)) if part > NAMED]
        count = counted(lost.shape[1], "direction")
        return [f"the markers do not determine {count} of motion, of {choices(names, 12)}, which "
                "stay near the start"]  # fmt: skip

    def _doubts(self, q: Array, residual: Array, slope: Array, smooth: Any) -> list[str]:
        told, t = list[str](), self.trial.t
        if smooth is None and len(bad := np.flatnonzero(slope > GRADIENT * self.size)):
            told.append(f"not converged in {counted(len(bad), 'frame')}, first at {t[bad[0]]:g} s")
        if unseen := int((~np.isfinite(residual)).all(axis=1).sum()):
            how = "stay as the last" if smooth is None else "are smooth between the others"
            told.append(f"no marker is seen in {counted(unseen, 'frame')}, which {how}")
        listed = [name for name, _ in coordinates(self.mech)[1]]
        for k in range(1, len(q)):
            if (far := self._far(q[k - 1], q[k])).any():
                told.append(f"{listed[int(far.argmax())]} jumps between {t[k - 1]:g} and {t[k]:g} "
                            "s: a marker is perhaps exchanged or at a wrong place")  # fmt: skip
        place = self.points(q)[1]
        across = ((place[:, :, None] - self.place[:, None]) ** 2).sum(axis=3)  # site, marker
        own = np.einsum("nii->ni", across)
        now, other = own[:, :, None] + own[:, None], across + across.transpose(0, 2, 1)
        swapped = (other < now / 2) & (now > 16 * np.nanmedian(own)) & (now > EPS)
        for i, j in zip(*np.nonzero(np.triu(swapped.any(axis=0), 1))):
            k = np.flatnonzero(swapped[:, i, j])
            told.append(f"{self.names[i]} and {self.names[j]} look exchanged in "
                        f"{counted(len(k), 'frame')}, first at {t[k[0]]:g} s")  # fmt: skip
        if np.nanmax(residual, initial=0.0) <= ROUNDING * self.size:
            told.append("every marker is exactly at its site: are these markers of a model?")
        return told


def _before(kinds: list[str]) -> Array:
    """Return which coordinates of a joint carry which, a half each where the order is free.

    A free joint moves before it turns, although its angular velocity comes first.
    """
    order: list[float] = []
    for n, kind in enumerate(kinds):
        order += {"ball": [n] * 3, "free": [n + 0.5] * 3 + [n] * 3}.get(kind, [n])
    first, last = np.array(order)[:, None], np.array(order)
    found = np.where(first < last, 1.0, np.where(first == last, 0.5, 0.0))
    np.fill_diagonal(found, 1.0)
    return found


def advanced(mech: Mechanism, q: Array, step: Array) -> Array:
    """Return positions (n, nq) after finite displacements (n, nv), as `Rows.advanced`."""
    q, (of_q, of_v) = q.copy(), plan(mech.packed).plain
    q[:, of_q] += step[:, of_v]
    for _, i, j in mech.packed.quaternions:
        q[:, i : i + 4] = times(exponential(step[:, j : j + 3]), q[:, i : i + 4])
        q[:, i : i + 4] /= np.linalg.norm(q[:, i : i + 4], axis=1)[:, None]
    return q


def exponential(turn: Array) -> Array:
    """Return the quaternions (..., 4) of rotation vectors (..., 3)."""
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    return np.concatenate((np.cos(angle / 2), turn * np.sinc(angle / (2 * np.pi)) / 2), axis=-1)


def times(p: Array, q: Array) -> Array:
    """Return products (..., 4) of quaternions [w, x, y, z]."""
    w = p[..., :1] * q[..., :1] - (p[..., 1:] * q[..., 1:]).sum(axis=-1, keepdims=True)
    u = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate((w, u), axis=-1)

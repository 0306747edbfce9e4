"""The fit of a mechanism to the markers of a trial: costs, slopes and the search.

Each frame is a least-squares problem, Σ w |x(q) - x̂|², within limits and closed loops. All frames
are solved at once by damped Gauss-Newton steps, each from the solution of a frame nearby. A
coordinate at its limit is held there as long as its gradient points beyond it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..analysis.inverse import bounds
from ..analysis.rows import Rows, apart, turns
from ..dynamics.many import Twists, plan, twists
from ..errors import PgraphError, Problem, choices, refusal, shown
from ..mechanism import Mechanism
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
from .trial import Array, Trial, known

BLOCK = 16  # frames that start from the same solution
STARTS = 40  # positions from which the first frame is solved
PROMISING = 8  # steps after which the best of as many are pursued
ROUNDS = 200  # steps at most
CLOSING = 20  # steps that close loops

Progress = Callable[[float], Any] | None


class Stopped(PgraphError):
    """A progress function has returned False, which stops the call."""


def tell(progress: Progress, fraction: float) -> None:
    """Report a completed fraction. Raises Stopped if the function returns False."""
    if progress is not None and progress(fraction) is False:
        raise Stopped(
            Problem("progress", "", "the call was stopped, as its function returned False")
        )


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
        self.hinges = np.zeros(mech.nv, dtype=bool)  # coordinates that are back after a turn
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
            raise refusal("track", "trial", text)
        trial = trial.with_up(mech.model.up)
        sites = {s.name: s for s in mech.model.sites}
        weights, labels = dict(weights or {}), dict(labels or {})
        for field, names in (("weights", weights), ("markers", labels)):
            for name in names:
                known("track", field, "site", name, sites)
        for name, label in labels.items():
            known("track", "markers", f"marker of site {name!r}", label, trial.markers)
        for name, weight in weights.items():
            if not (isinstance(weight, (int, float)) and 0.0 <= weight < np.inf):
                text = f"the weight of {name!r} must be a number >= 0, got {shown(weight)}"
                raise refusal("track", "weights", text)
        label_of = {name: labels.get(name, name) for name in sites}
        seen = {x for x, m in trial.markers.items() if np.isfinite(m).any()}
        used = [x for x in sites if label_of[x] in seen and weights.get(x, 1.0) > 0.0]
        if not used:
            have = choices(trial.markers, 12) or "none"
            text = f"has no marker with the name of a site; its markers are {have}, and the sites "
            text += f"{choices(sites, 12) or 'none'}; markers={{'SITE': 'LABEL'}} matches them"
            raise refusal("track", "trial", text)
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
            going = self.slope(P, g[live], H[live]) > ROUNDING * self.size
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

    def slope(self, P: Array, g: Array, H: Array) -> Array:
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
                if self.far(before, q[k]).any():
                    new, value = self.descended(before[None].copy(), np.array([k]))
                    if value[0] <= (1 + NOTABLE) * cost[k] + EPS:
                        q[k], cost[k] = new[0], value[0]
        return q

    def _apart(self, one: Array, other: Array) -> Array:
        return np.abs(apart(self.mech, one, other)) / self.scale

    def far(self, one: Array, other: Array) -> Array:
        """Return the velocities (nv,) that jump between two positions."""
        if np.abs(other - one).max(initial=0.0) < min(1.0, self.size) * LONGEST_STEP / 4:
            return np.zeros(self.mech.nv, dtype=bool)  # numbers of a turn are half of its angle
        return self._apart(one, other) > LONGEST_STEP


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

"""Marker tracking: the positions of a mechanism that are closest to the markers of a trial.

Each frame is a least-squares problem (Lu and O'Connor, J. Biomechanics 32 (1999) 129-134), or all
frames are smoothed at once.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import choices, counted, explained, nearest_name, refusal, shown
from ..mechanism import Mechanism, mechanism_of
from ..model import Model, Motion, Table
from ..model.files import write_atomic
from ..result.columns import Column, coordinates
from ..tolerances import EPS, NAMED, ROUNDING, SOLVED
from .markers import Markers, Progress, tell
from .smoothing import smoothed
from .trial import Array, Trial

GRADIENT = SOLVED / 10  # slope below which a frame is solved, relative to lengths


@explained
@dataclass(frozen=True, eq=False)
class Tracking:
    """The motion of a mechanism that follows the markers of a trial.

    `print(fit)` tells how well it does, and what the markers do not determine.
    """

    mechanism: Mechanism
    trial: Trial  # its positions are in the axes of the model
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
        spans = {name: j.q for name, j in self.mechanism.joints.items()}
        if joint not in spans or spans[joint].stop != spans[joint].start + 1:
            text = f"needs a joint with one coordinate; {nearest_name(joint, spans)}"
            raise refusal("motion", "joint", f"{shown(joint)} {text}")
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
        raise refusal("track", "smooth", text)
    problem = Markers.of(mech, trial, weights, markers)
    v = vdot = chosen = None
    found = problem.solved(mech.assemble(q)[0], progress)
    if smooth is not None and smooth is not False:
        found, v, vdot, chosen = smoothed(problem, found, smooth)
    tell(progress, 1.0)
    return _answer(problem, found, v, vdot, chosen)


def followed(fit: Tracking) -> Tracking:
    """Return the motion that follows the markers of a smoothed one, each frame alone."""
    mech, sites = fit.mechanism, {s.name: s for s in fit.mechanism.model.sites}
    number = mech.topology.number
    problem = Markers(
        mech, fit.trial, fit.markers,
        np.array([number(sites[x].body) - 1 for x in fit.markers]),
        np.array([sites[x].point for x in fit.markers], float),
        np.zeros_like(fit.offset), fit.weights, [],
    )  # fmt: skip
    problem.place = problem.points(fit.q)[1] - fit.offset
    q, _ = problem.descended(fit.q.copy(), np.arange(len(fit.q)))
    return _answer(problem, q, None, None, None)


def _answer(problem: Markers, q: Array, v: Any, vdot: Any, smooth: float | None) -> Tracking:
    """Return the result, with what the markers do not determine and what is odd."""
    cost, g, H, _ = problem.normal(q, np.arange(len(q)))
    off = problem.points(q)[1] - problem.place
    P = problem.free(q, g)
    slope = problem.slope(P, g, H)
    seen = np.isfinite(problem.place[..., 0])
    residual = np.linalg.norm(off, axis=2)
    freedom = 3 * int(seen.sum()) - float(np.einsum("nii->", P))
    covariance = np.linalg.pinv(P @ H @ P, rcond=SOLVED, hermitian=True)
    covariance *= float(cost.sum()) / max(freedom, 1.0)
    report = [*problem.report, *_doubts(problem, q, residual, slope, smooth)]
    return Tracking(
        problem.mech, problem.trial, problem.trial.t, q, problem.names, off, problem.weight, slope,
        v, vdot, smooth, tuple(_undetermined(problem, H, P)), tuple(report), covariance,
    )  # fmt: skip


def _undetermined(problem: Markers, H: Array, P: Array) -> list[str]:
    """Return a sentence on the directions of motion that no marker shows in any frame."""
    listed = [name for name, _ in coordinates(problem.mech)[1]]
    units = problem.scale[:, None] * problem.scale / problem.size**2
    shown_ways = (P @ H @ P).sum(axis=0) * units / (problem.weight.sum() * len(H))
    sizes, ways = np.linalg.eigh(shown_ways + np.eye(len(units)) - P.mean(axis=0))
    lost = ways[:, sizes <= SOLVED]
    if not lost.shape[1]:
        return []
    names = [x for x, part in zip(listed, np.linalg.norm(lost, axis=1)) if part > NAMED]
    count = counted(lost.shape[1], "direction")
    return [f"the markers do not determine {count} of motion, of {choices(names, 12)}, which "
            "stay near the start"]  # fmt: skip


def _doubts(problem: Markers, q: Array, residual: Array, slope: Array, smooth: Any) -> list[str]:
    told, t = list[str](), problem.trial.t
    if smooth is None and len(bad := np.flatnonzero(slope > GRADIENT * problem.size)):
        told.append(f"not converged in {counted(len(bad), 'frame')}, first at {t[bad[0]]:g} s")
    if unseen := int((~np.isfinite(residual)).all(axis=1).sum()):
        how = "stay as the last" if smooth is None else "are smooth between the others"
        told.append(f"no marker is seen in {counted(unseen, 'frame')}, which {how}")
    listed = [name for name, _ in coordinates(problem.mech)[1]]
    for k in range(1, len(q)):
        if (far := problem.far(q[k - 1], q[k])).any():
            told.append(f"{listed[int(far.argmax())]} jumps between {t[k - 1]:g} and {t[k]:g} "
                        "s: a marker is perhaps exchanged or at a wrong place")  # fmt: skip
    place = problem.points(q)[1]
    across = ((place[:, :, None] - problem.place[:, None]) ** 2).sum(axis=3)  # site, marker
    own = np.einsum("nii->ni", across)
    now, other = own[:, :, None] + own[:, None], across + across.transpose(0, 2, 1)
    swapped = (other < now / 2) & (now > 16 * np.nanmedian(own)) & (now > EPS)
    for i, j in zip(*np.nonzero(np.triu(swapped.any(axis=0), 1))):
        k = np.flatnonzero(swapped[:, i, j])
        told.append(f"{problem.names[i]} and {problem.names[j]} look exchanged in "
                    f"{counted(len(k), 'frame')}, first at {t[k[0]]:g} s")  # fmt: skip
    if np.nanmax(residual, initial=0.0) <= ROUNDING * problem.size:
        told.append("every marker is exactly at its site: are these markers of a model?")
    return told

"""Motion capture on the page: a trial over the model, its fit, joint moments and scaling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import combinations
from typing import Any, Literal, Self

import numpy as np

import pgraph_core as pg
from pgraph_core.dynamics.many import motions
from pgraph_core.show.notebook import between
from pgraph_core.show.shapes import to_wxyz

from .. import model as model_
from .. import pose
from ..core.cells import Refusal
from ..core.events import Request
from ..core.jobs import Job, Report
from ..core.state import Names, derive
from ..pose import Pose
from ..run import Run, same_motion

NEAREST = "auto"  # the body that is nearest to a plate while it is loaded
NOT_USED = ""  # the label of a site without a marker, and the body of a plate that bears nobody
File = tuple[str, bytes]  # name, content


@dataclass(frozen=True)
class Reading:
    """The way in which the files of a trial are read, "" where the files state it."""

    up: str = ""
    units: str = ""
    subject: str = ""


@dataclass(frozen=True)
class Take:
    """A trial on the page, and what is asked of it."""

    files: tuple[File, ...]  # with the markers, and with the force plates if they are in another
    trial: pg.Trial
    reading: Reading = Reading()
    labels: Mapping[str, str] = field(default_factory=dict)  # {site: marker} of other names
    weights: Mapping[str, float] = field(default_factory=dict)  # weights of sites
    smooth: bool = False
    cutoff: float | None = None  # [Hz]
    band: bool = True
    plates: Mapping[str, str] = field(default_factory=dict)  # {plate: body}
    pairs: tuple[tuple[str, str, str], ...] = ()  # (body, site, site) that scale
    mass: float | None = None  # [kg]

    def label(self, site: str) -> str:
        """Return the marker of a site if there is one in the trial, else NOT_USED."""
        label = self.labels.get(site, site)
        return label if label in self.seen else NOT_USED

    @property
    def seen(self) -> list[str]:
        """The markers that are seen in some frame."""
        return [name for name, x in self.trial.markers.items() if np.isfinite(x).any()]

    @property
    def bears(self) -> dict[str, str]:
        """The body that each plate bears, for `pg.joint_moments`."""
        wanted = {p.name: self.plates.get(p.name, NEAREST) for p in self.trial.plates}
        return {plate: body for plate, body in wanted.items() if body != NOT_USED}

    def of(self, names: Names) -> Self:
        """Return the take after parts of the model were renamed."""

        def now(kind: str, name: str) -> str:
            return names.get((kind, name), name)

        renamed = [site for kind, site in names if kind == "sites"]
        labels = {site: label for site in renamed if (label := self.label(site))}
        return replace(
            self,
            labels={now("sites", s): label for s, label in {**self.labels, **labels}.items()},
            weights={now("sites", s): w for s, w in self.weights.items()},
            plates={plate: now("bodies", body) for plate, body in self.plates.items()},
            pairs=tuple(
                (now("bodies", b), now("sites", one), now("sites", other))
                for b, one, other in self.pairs
            ),
        )


@dataclass(frozen=True, eq=False)
class Fitted:
    """A motion of a model that follows a trial: its fit, or the trial's own coordinates."""

    model: pg.Model
    take: Take
    motion: pg.Tracking | pg.Trial
    q: np.ndarray  # (n, nq)
    pose: np.ndarray  # (n, nb, 7) x y z [m], w x y z

    @property
    def t(self) -> np.ndarray:
        """The times (n,) [s]."""
        return self.motion.t

    @cached_property
    def travels(self) -> np.ndarray:
        """An array (3,) with 1 for each axis along which the bodies travel, else 0."""
        return (np.ptp(self.pose[:, :, :3].mean(axis=1), axis=0) > derive(self.model).size) * 1.0


@dataclass(frozen=True)
class Loads:
    """The joint moments of a fit."""

    fitted: Fitted
    moments: pg.Moments
    cutoff: float | None


@dataclass(frozen=True)
class Fit(Job):
    """The search for the motion of a trial."""

    NAME, FIELD, PROBLEM = "fit", "fitting", "fit_problem"
    take: Take

    def work(self, progress: Report) -> Fitted:
        take, mech = self.take, pg.Mechanism(self.model)
        if not take.trial.markers:
            q = take.trial.with_up(self.model.up).positions(mech)
            return Fitted(self.model, take, take.trial, q, _poses(mech, q))
        unused = [s.name for s in self.model.sites if take.label(s.name) == NOT_USED]
        labels = {s: label for s, label in take.labels.items() if s not in unused}
        fit = pg.track(
            mech, take.trial, weights={**take.weights, **dict.fromkeys(unused, 0.0)},
            markers=labels, smooth=True if take.smooth else None, progress=progress,
        )  # fmt: skip
        return Fitted(self.model, take, fit, fit.q, _poses(mech, fit.q))

    def ended(self, state: State, result: Fitted) -> State:
        return replace(shown(state), fitted=result, loads=None, moments_problem="")


def _poses(mech: pg.Mechanism, q: np.ndarray) -> np.ndarray:
    """Return the poses (n, nb, 7) of bodies at positions."""
    none = np.zeros((len(q), mech.nv))
    found = motions(mech.packed, q, none, none)
    n, nb = found.place.shape[:2]
    turned = to_wxyz(np.asarray(found.turn).reshape(-1, 3, 3)).reshape(n, nb, 4)
    return np.concatenate((found.place, turned), axis=2)


@dataclass(frozen=True)
class Dynamics(Job):
    """The computation of joint moments."""

    NAME, FIELD, PROBLEM = "computation of moments", "computing", "moments_problem"
    fitted: Fitted
    take: Take

    def work(self, progress: Report) -> Loads:
        motion, take = self.fitted.motion, self.take
        found = pg.joint_moments(
            self.model, motion, plates=take.bears, cutoff=take.cutoff,
            band=take.band and not no_band(self.fitted), progress=progress,
        )  # fmt: skip
        return Loads(self.fitted, found, take.cutoff)

    def ended(self, state: State, result: Loads) -> State:
        return replace(state, loads=result)


def no_band(fitted: Fitted) -> str:
    """Return the reason why the moments of a fit have no band, or ""."""
    motion = fitted.motion
    if not isinstance(motion, pg.Tracking):
        return "A band needs markers, whose residuals show their errors."
    return "A model with closed loops has no band." * bool(len(motion.mechanism.packed.active))


@dataclass(frozen=True)
class Client(model_.Client, pose.Client):
    pass


@dataclass(frozen=True)
class State(model_.State, pose.State):
    """The trial, and what was found of it.

    The trial is played in place of the last run until there is another one.
    """

    clients: Mapping[int, Client] = field(default_factory=dict)
    take: Take | None = None
    beside: Run | None = None  # the last run when the trial was shown
    fitting: Fit | None = None
    fit_problem: str = ""
    fitted: Fitted | None = None
    computing: Dynamics | None = None
    moments_problem: str = ""
    loads: Loads | None = None
    scaled: pg.Scaling | None = None

    def opened(self, before: Any) -> Self:
        state = super().opened(before)
        return replace(
            state, take=None, beside=None, fitting=None, fit_problem="", fitted=None,
            computing=None, moments_problem="", loads=None, scaled=None,
        )  # fmt: skip

    def followed(self, before: Any, names: Names) -> Self:
        state = super().followed(before, names)
        if state.take is None:
            return state
        fitted, loads = state.fitted, state.loads
        current = fitted is not None and fitted.model is before.model
        if fitted is not None and current and same_motion(before.model, state.model):
            fitted = replace(fitted, model=state.model)
            loads = loads and replace(loads, fitted=fitted)
        state = replace(state, take=state.take.of(names), fitted=fitted, loads=loads)
        if not before.shows_trial:
            return state
        return replace(state, playback=before.playback, beside=state.last_run)

    @property
    def shows_trial(self) -> bool:
        """True while the trial is played, and not a run."""
        return self.take is not None and self.live is None and self.last_run is self.beside

    @property
    def run(self) -> Run | None:
        return None if self.shows_trial else super().run

    @property
    def earlier(self) -> Run | None:
        return None if self.shows_trial else super().earlier

    @property
    def instead(self) -> str:
        files = () if self.take is None or not self.shows_trial else self.take.files
        return " and ".join(name for name, _ in files)

    @property
    def travels(self) -> np.ndarray:
        if not self.shows_trial:
            return super().travels
        return np.zeros(3) if self.following is None else self.following.travels

    @property
    def instants(self) -> Sequence[float]:
        return self._times.tolist() if self.shows_trial else super().instants

    @property
    def t_start(self) -> float:
        return float(self._times[0]) if self.shows_trial else super().t_start

    @property
    def t_end(self) -> float:
        return float(self._times[-1]) if self.shows_trial else super().t_end

    @property
    def _times(self) -> np.ndarray:
        return np.zeros(1) if self.take is None else times(self.take.trial)

    @property
    def following(self) -> Fitted | None:
        """The fit of the present model, if there is one."""
        fitted = self.fitted
        return fitted if fitted is not None and fitted.model is self.model else None

    @property
    def pose(self) -> Pose | None:
        by_hand, fitted = super().pose, self.following
        if by_hand is not None or fitted is None or not self.shows_trial:
            return by_hand
        return _pose(fitted, self.playback.time)


@lru_cache(maxsize=4)
def _pose(fitted: Fitted, time: float) -> Pose:
    """Return the pose of a fit at a time, one object for each of the last times."""
    positions, wxyz = between(fitted.t, fitted.pose, float(np.clip(time, *fitted.t[[0, -1]])))
    q = fitted.q[int(np.abs(fitted.t - time).argmin())]
    return Pose(fitted.model, None, time, q, positions, wxyz)


def times(trial: pg.Trial) -> np.ndarray:
    """Return the times of the frames [s], or of the plates if there are none."""
    if len(trial.t):
        return trial.t
    return trial.plates[0].t if trial.plates else np.zeros(1)


def shown(state: State) -> State:
    """Return the state that plays the trial from its start."""
    assert state.take is not None
    start = float(times(state.take.trial)[0])
    playback = replace(state.playback, time=start, playing=False, preview=False, held=False)
    return replace(state, beside=state.last_run, posed=None, playback=playback)


# -- scaling -------------------------------------------------------------------------------------


def proposed(model: pg.Model, take: Take) -> tuple[tuple[str, str, str], ...]:
    """Return the pair of sites of each body that are farthest apart, of those with markers."""
    found = []
    for body in model.bodies:
        own = [s for s in model.sites if s.body == body.name and take.label(s.name)]
        pairs = [(np.linalg.norm(np.subtract(a.point, b.point)), a.name, b.name)
                 for a, b in combinations(own, 2)]  # fmt: skip
        if pairs and (best := max(pairs))[0] > 0.0:
            found.append((body.name, best[1], best[2]))
    return tuple(found)


def scaled(model: pg.Model, take: Take) -> tuple[pg.Model, pg.Scaling]:
    """Scale a model to the trial. Raises PgraphError, Refusal."""
    pairs: dict[str, list[tuple[str, str]]] = {}
    for body, one, other in take.pairs:
        if body and one and other:
            pairs.setdefault(body, []).append((one, other))
    if not pairs:
        raise Refusal("Choose two sites of a body, whose distance scales it.")
    labels = {name: label for s in model.sites if (label := take.label(name := s.name))}
    return pg.scale(model, take.trial, pairs=pairs, markers=labels, mass=take.mass)


class ExportCapture(Request):
    """Download the fit or the moments as a table."""

    what: Literal["fit", "moments"]

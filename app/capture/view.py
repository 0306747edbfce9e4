"""The tab for motion capture, and its markers, residuals and plates in the 3D view."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.errors import choices, counted
from pgraph_core.result.columns import coordinates
from pgraph_core.show.shapes import to_matrix

from ..core.bridge import Bridge
from ..core.views import Host, Payload, Place, requests, topic
from ..pose import poses
from . import NEAREST, ExportCapture, Fitted, Loads, State, Take, no_band, times

PARTS = (
    "derived", "model", "take", "beside", "last_run", "live", "fitting", "fit_problem", "fitted",
    "computing", "moments_problem", "loads", "scaled", "errands",
)  # fmt: skip
DRAWN = 300  # points of a drawn curve
SEEN, SPARE, MISSED = (40, 140, 255), (140, 148, 158), (230, 90, 20)
PUSH, CORNER = (30, 160, 90), (110, 118, 128)
LENGTH = 1 / 2  # length of the arrow of a plate's largest force, over the size of the model


def capture(state: State) -> Payload:
    """Return the content of the tab."""
    take = state.take
    if take is None:
        return {"take": None, "reading": _reading(state)}
    fitted, loads = state.fitted, state.loads
    return {
        "take": _told(take),
        "reading": _reading(state),
        "shown": state.shows_trial,
        "sites": sites(state, take),
        "spare": choices(spare(state, take), 12),
        "markers": take.seen,
        "missing": missing(state, take),
        "pairs": [list(pair) for pair in take.pairs],
        "bodies": [body.name for body in state.model.bodies],
        "mass": take.mass,
        "total": float(sum(body.mass for body in state.model.bodies)),
        "scaled": None if state.scaled is None else repr(state.scaled)[1:-1].splitlines(),
        "fit": {
            "smooth": take.smooth, "job": _job(state, state.fitting), "problem": state.fit_problem,
            "found": None if fitted is None else fit(state, fitted),
        },
        "moments": {
            "cutoff": take.cutoff, "usual": "none" if take.smooth else "6",
            "band": take.band, "no_band": "" if fitted is None else no_band(fitted),
            "plates": [[p.name, take.plates.get(p.name, NEAREST)] for p in take.trial.plates],
            "job": _job(state, state.computing), "problem": state.moments_problem,
            "ready": state.following is not None,
            "found": None if loads is None else moments(state, loads),
        },
    }  # fmt: skip


def _reading(state: State) -> bool:
    return any(errand.apart and errand.label.startswith("open ") for errand in state.errands)


def _told(take: Take) -> Payload:
    """Return what was read, and what was odd about it."""
    trial, t = take.trial, times(take.trial)
    parts = [
        counted(len(trial.t), "frame"), f"{t[0]:g} to {t[-1]:g} s",
        counted(len(trial.markers), "marker"), counted(len(trial.plates), "force plate"),
    ]  # fmt: skip
    if trial.coordinates:
        parts.append(counted(len(trial.coordinates), "coordinate"))
    return {
        "files": [name for name, _ in take.files],
        "what": ", ".join(parts),
        "report": [sentence(text) for text in trial.report],
        **vars(take.reading),
        "found_up": trial.up or "unknown",
        "is_markers": bool(trial.markers),
    }


def sentence(text: str) -> str:
    """Return a text of a report as a sentence."""
    return text if text.endswith((".", "?")) else f"{text}."


def _job(state: State, job: Any) -> Payload | None:
    if job is None:
        return None
    if not state.ready:
        return {"text": "waits until the fast code is compiled", "fraction": None}
    return {"text": f"{100 * job.fraction:.0f} %", "fraction": job.fraction or None}


def sites(state: State, take: Take) -> list[Payload]:
    """Return the sites with their markers, weights and distances [mm], the worst first."""
    fitted = state.following
    motion = None if fitted is None else fitted.motion
    size: dict[str, tuple[float, float]] = {}
    if isinstance(motion, pg.Tracking):
        for name, x in zip(motion.markers, 1000 * motion.residual.T):
            if np.isfinite(x).any():
                size[name] = float(np.sqrt(np.nanmean(x**2))), float(np.nanmax(x))
    found = [
        {
            "name": s.name, "body": s.body, "label": take.label(s.name),
            "weight": take.weights.get(s.name, 1.0), "rms": size.get(s.name, (None,))[0],
            "most": size.get(s.name, (None, None))[1],
        }
        for s in state.model.sites
    ]  # fmt: skip
    return sorted(found, key=lambda row: (not row["label"], -(row["rms"] or 0.0)))


def spare(state: State, take: Take) -> list[str]:
    """Return the markers that belong to no site."""
    used = {take.label(s.name) for s in state.model.sites}
    return [label for label in take.seen if label not in used]


def missing(state: State, take: Take) -> str:
    """Return what the fit needs before it can start, or ""."""
    if not take.trial.markers:
        if take.trial.coordinates:
            return ""
        return "This file has force plates alone: open the one with markers or coordinates too."
    if not state.model.sites:
        return "The model has no sites, which markers follow: add them under Connections."
    if not any(take.label(s.name) for s in state.model.sites):
        return "No marker has the name of a site: choose the marker of each site below."
    return ""


def fit(state: State, fitted: Fitted) -> Payload:
    """Return the quality of a fit."""
    motion = fitted.motion
    stale = "" if fitted is state.following else "Found before the model was changed."
    if not isinstance(motion, pg.Tracking):
        return {"title": "The coordinates of the trial", "stale": stale, "notes": [], "t": []}
    rms = 1000 * motion.rms
    by_marker = {
        name: float(np.sqrt(np.nanmean(x**2)))
        for name, x in zip(motion.markers, 1000 * motion.residual.T) if np.isfinite(x).any()
    }  # fmt: skip
    worst = max(by_marker, key=by_marker.__getitem__)
    total = float(np.sqrt(np.nanmean(motion.residual**2)))
    title = f"{1000 * total:.3g} mm rms over {counted(len(motion.markers), 'marker')}"
    notes = [x for x in motion.report if x not in fitted.take.trial.report]
    step = -(-len(motion.t) // DRAWN)
    return {
        "title": f"{title}; worst is {worst} with {by_marker[worst]:.3g} mm",
        "stale": stale,
        "notes": [sentence(x) for x in (*motion.undetermined, *notes)],
        "t": motion.t[::step].tolist(),
        "rms": rms[::step].tolist(),
    }


def moments(state: State, loads: Loads) -> Payload:
    """Return the curves of moments, with their bands."""
    found, step = loads.moments, -(-len(loads.moments.t) // DRAWN)
    units = ["N m" if unit == "rad" else "N" for _, unit in coordinates(found.mechanism)[1]]
    current = loads.fitted is state.following
    ends = [None if x is None else x[::step].T.tolist() for x in (found.low, found.high)]
    lines = repr(found)[1:-1].splitlines()[1:]
    return {
        "stale": "" if current else "Found from an earlier fit.",
        "title": f"{counted(len(found.names), 'curve')} of joint moments and forces",
        "band": found.low is not None,
        "t": found.t[::step].tolist(),
        "curves": [
            {
                "name": name, "unit": unit, "y": y.tolist(),
                "low": ends[0] and ends[0][i], "high": ends[1] and ends[1][i],
            }
            for i, (name, unit, y) in enumerate(zip(found.names, units, found.torque[::step].T))
        ],
        "notes": [sentence(line.strip()) for line in lines],
    }  # fmt: skip


# -- downloads -----------------------------------------------------------------------------------


class TableView:
    """Sends the tables that pages ask for."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for asked in requests(old, new, ExportCapture):
            if (content := table(new, asked.what)) is not None and new.take is not None:
                stem = re.sub(r"[^\w-]+", "_", new.take.files[0][0].rpartition(".")[0]) or "trial"
                name = f"{stem}_{'motion' if asked.what == 'fit' else 'moments'}.csv"
                self._bridge.download(asked.client, name, content.encode())


def table(state: State, what: str) -> str | None:
    """Return the fit or the moments as CSV, or None if there is none."""
    if what == "moments":
        return None if state.loads is None else state.loads.moments.to_csv()
    motion = None if state.fitted is None else state.fitted.motion
    return motion.to_csv() if isinstance(motion, pg.Tracking) else None


# -- the 3D view ---------------------------------------------------------------------------------


class MarkersView:
    """Markers as dots, their distances from the sites as lines, and plates with their forces."""

    def __init__(self, bridge: Bridge):
        self._server = bridge.server
        self._nodes: dict[str, Any] = {}

    def render(self, old: State, new: State) -> None:
        same = all((
            new.take is old.take, new.following is old.following, new.derived is old.derived,
            new.playback.time == old.playback.time, new.pose is old.pose, new.run is old.run,
        ))  # fmt: skip
        if same or (new.take is None and not self._nodes):
            return
        with self._server.atomic():
            self._draw(new)

    def _draw(self, state: State) -> None:
        take, time = state.take, state.playback.time
        if take is None:
            for node in self._nodes.values():
                node.remove()
            self._nodes = {}
            return
        size, scene = state.derived.size, self._server.scene
        trial = take.trial.with_up(state.model.up)
        matched = {label: s for s in state.model.sites if (label := take.label(s.name))}
        places = {name: marker_at(trial, name, time) for name in take.seen}
        for kind, color, names in (
            ("markers", SEEN, [x for x in places if x in matched]),
            ("spare", SPARE, [x for x in places if x not in matched]),
        ):
            points = np.array([places[x] for x in names if np.isfinite(places[x]).all()])

            def dots(points: np.ndarray, kind: str = kind, color: Any = color) -> Any:
                return scene.add_point_cloud(
                    f"/capture/{kind}", points, colors=color, point_size=size / 40,
                    point_shape="circle", precision="float32",
                )  # fmt: skip

            self._set(kind, points.reshape(-1, 3), dots)
        self._set("residuals", missed(state, places), lambda lines: scene.add_line_segments(
            "/capture/residuals", lines, colors=MISSED, thickness=4.0, thickness_units="screen",
        ))  # fmt: skip
        self._set("corners", corners(trial), lambda lines: scene.add_line_segments(
            "/capture/corners", lines, colors=CORNER, thickness=2.0, thickness_units="screen",
        ))  # fmt: skip
        self._set("forces", forces(trial, time, size), lambda arrows: scene.add_arrows(
            "/capture/forces", arrows, colors=PUSH, shaft_radius=size / 150,
            head_radius=size / 60, head_length=size / 30,
        ))  # fmt: skip

    def _set(self, kind: str, points: np.ndarray, add: Any) -> None:
        """Draw points in the node of a kind. A node with another number of points is made anew."""
        node, points = self._nodes.get(kind), points.astype(np.float32)
        if node is not None and node.points.shape == points.shape and len(points):
            if not np.array_equal(node.points, points):
                node.points = points
            return
        if node is not None:
            self._nodes.pop(kind).remove()
        if len(points):
            self._nodes[kind] = add(points)


def marker_at(trial: pg.Trial, name: str, time: float) -> np.ndarray:
    """Return the place (3,) of a marker at a time, nan where it is not seen or beyond the trial."""
    t, x = trial.t, trial.markers[name]
    beside = np.median(np.diff(t)) if len(t) > 1 else np.inf
    if not t[0] - beside <= time <= t[-1] + beside:
        return np.full(3, np.nan)
    k = int(np.clip(np.searchsorted(t, time), 1, max(len(t) - 1, 1)))
    if len(t) == 1:
        return x[0]
    share = float(np.clip((time - t[k - 1]) / (t[k] - t[k - 1]), 0.0, 1.0))
    return x[k - 1] if share == 0.0 else x[k] if share == 1.0 else (
        (1 - share) * x[k - 1] + share * x[k]
    )  # fmt: skip


def missed(state: State, places: dict[str, np.ndarray]) -> np.ndarray:
    """Return the lines (n, 2, 3) from the sites of a fitted model to their markers."""
    take, found = state.take, list[np.ndarray]()
    if take is None or state.following is None or not state.shows_trial:
        return np.zeros((0, 2, 3))
    positions, wxyz = poses(state)
    turned = to_matrix(wxyz)
    for s in state.model.sites:
        place = places.get(take.label(s.name))
        k = state.derived.number.get(s.body)
        if place is not None and k is not None and np.isfinite(place).all():
            found.append(np.stack((positions[k - 1] + turned[k - 1] @ np.array(s.point), place)))
    return np.array(found).reshape(-1, 2, 3)


def corners(trial: pg.Trial) -> np.ndarray:
    """Return the edges (n, 2, 3) of the plates."""
    around = [np.stack((p.corners, np.roll(p.corners, -1, axis=0)), 1)
              for p in trial.plates if p.corners is not None]  # fmt: skip
    return np.concatenate(around) if around else np.zeros((0, 2, 3))


def forces(trial: pg.Trial, time: float, size: float) -> np.ndarray:
    """Return arrows (n, 2, 3) of the plates' forces on the feet at a time."""
    most = max((float(np.linalg.norm(p.force, axis=1).max(initial=0.0)) for p in trial.plates),
               default=0.0)  # fmt: skip
    found = list[np.ndarray]()
    for plate in trial.plates:
        k = int(np.abs(plate.t - time).argmin())
        if most and np.isfinite(plate.point[k]).all() and plate.t[0] <= time <= plate.t[-1]:
            end = plate.point[k] + LENGTH * size / most * plate.force[k]
            found.append(np.stack((plate.point[k], end)))
    return np.array(found).reshape(-1, 2, 3)


VIEWS = (
    Place(topic("capture", capture, *PARTS, "ready", seen="capture"), 57,
          Host("capture", "drawer", "Capture")),
    Place(lambda desk: TableView(desk.bridge), 57),
    Place(lambda desk: MarkersView(desk.bridge), 72),
)  # fmt: skip

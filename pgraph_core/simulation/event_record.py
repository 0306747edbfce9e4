"""Records of the contact points and limits of runs with events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.states import bodies_over
from ..engine.records import SWING
from ..packing import Array
from ..result.records import FREE, PHASES, STOP, ContactRecord

if TYPE_CHECKING:
    from .contact_events import ContactEvents
    from .event_scene import EventScene


def pushes(scene: EventScene, rows: Any) -> Array:
    """Return the forces (n, points and pairs, 3) at these frames [N], those of limits [N m, N]
    in the first entry."""
    frames, points = scene.frames[rows], scene.contact_points
    own = frames["force"].copy()
    limits = [s for s, point in enumerate(points) if point.limit is not None]
    own[:, limits] = 0.0
    own[:, limits, 0] = frames["normal_force"][:, limits]
    pairs = [point.pair for point in points]
    whole = [own[:, np.isin(pairs, name)].sum(axis=1) for name in dict.fromkeys(pairs)]
    return np.concatenate((own, np.stack(whole, axis=1)), axis=1)


def record(
    events: ContactEvents,
    soft: ContactRecord,
    states: tuple[Array, Array, Array],
    rows: Any,
) -> ContactRecord:
    """Return forces, gaps and slips for each point and contact pair over states (q, v, v')."""
    scene, mech, n = events.scene, events.mech, len(states[0])
    frames, codes = scene.frames[rows], scene.frames["phase"][rows]
    still = np.zeros((n, mech.nb, 6))
    origins = bodies_over(mech.packed.system, *states, still).pose[..., :3]
    found = {name: dict(getattr(soft, name)) for name in ("force", "gap", "slip", "limit")}
    normal: dict[str, Array] = {}
    phase: dict[str, Any] = {}
    wrench = still + soft.wrench if soft.wrench.size else still
    missed = soft.residual.copy() if len(soft.residual) else np.zeros((n, 3))
    for s, point in enumerate(scene.contact_points):
        frame, code = frames[:, s], codes[:, s]
        push, gap = frame["normal_force"].copy(), frame["gap"].copy()
        missed[:, 0] = np.maximum(missed[:, 0], -push)
        missed[:, 2] = np.maximum(missed[:, 2], -gap)
        if point.limit is not None:
            found["limit"][point.name] = point.limit.weights[0] * push
            found["gap"][point.name] = gap
            phase[point.name] = np.array((FREE, "", "", STOP))[code]
            continue
        b = mech.topology.number(point.body) - 1
        force = frame["force"]
        arm = frame["position"] - origins[:, b]
        own = np.concatenate((np.cross(arm, force), force), axis=1)
        drag = force - push[:, None] * scene.points[s]["normal"]
        beyond = np.linalg.norm(drag, axis=1) - point.friction * push
        missed[:, 1] = np.maximum(missed[:, 1], beyond)
        slip = np.linalg.norm(frame["slip_velocity"], axis=1)
        slip[code == SWING] = 0.0
        wrench[:, b] += own
        phase[point.name] = np.array(PHASES)[code]
        for name in dict.fromkeys((point.name, point.pair)):
            found["force"][name] = found["force"].get(name, 0.0) + own
            normal[name] = normal.get(name, 0.0) + push
            found["gap"][name] = np.minimum(found["gap"].get(name, np.inf), gap)
            found["slip"][name] = np.maximum(found["slip"].get(name, 0.0), slip)
    return ContactRecord(
        **found,
        wrench=wrench,
        residual=missed,
        normal=normal,
        phases=phase,
        events=tuple(events.ended.log),
    )

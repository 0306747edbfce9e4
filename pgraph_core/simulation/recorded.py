"""The result of a recorded run, with its notices."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..dynamics.scene import forces_of
from ..engine.arrays import Frames
from ..engine.motion import MEANS
from ..packing import Array, Ints
from ..packing.forces import drive_forces
from ..result import Result
from ..result.records import (
    NO_DERIVATIVES,
    NO_DRIVES,
    NO_FORCES,
    NOTHING,
    OF_CONSTRAINTS,
    OF_DRIVES,
    ContactRecord,
    Named,
)
from .advice import too_wide
from .continuing import left_by
from .jumping import jumped
from .lifted import lifted
from .means import means_between
from .on_curves import on_curves
from .on_wheels import on_wheels, pushing
from .pierced import pierced
from .remarks import (
    beyond_limits,
    creeping,
    off_curve,
    off_track,
    remembering,
    too_fast,
    touching,
    turns_unseen,
)
from .slipping import slipped

if TYPE_CHECKING:
    from .recording import Recording

FEW_FRAMES = 10  # fewer are no curve


class Estimate(NamedTuple):
    """The errors in q and in the states of controls at the times of a plan, as running maxima, and
    those of contact forces."""

    error: Array | None = None  # (n, 1 + nx) [rad, m], [units of the states], inf once unknown
    forces: Array | None = None  # (n,) of contacts [N] and limits [N m, N]
    notices: tuple[str, ...] = ()
    why: str = ""  # there is none


NO_ESTIMATE = Estimate()


def result_of(record: Recording, estimate: Estimate, timing: dict[str, float]) -> Result:
    """Return the requested frames of a run as a Result."""
    mech, plan, steps, ended = record.mech, record.plan, record.steps, record.ended
    counted = steps.counters
    rows, t, (q, v, vdot, wrenches, energy, drift, *touched) = _kept(record)
    nq, nv = mech.nq, mech.nv
    x = v[:, nv:]
    driven = NO_DRIVES
    if plan.driving:
        driven = Named(_of_drives(record, t, q, v), *OF_DRIVES)
    if record.size != (nq, nv):
        q, v, vdot = q[:, :nq], v[:, :nv], vdot[:, :nv]
    if len(t) >= FEW_FRAMES and counted["steps"] > 2 * len(t):
        ended.notices += turns_unseen(record, (t, q, v, vdot))
    forces, pulls = NO_FORCES, dict[str, Array]
    if len(plan.ever):
        read = partial(forces_of, record.scene.blocks, plan.ever)
        forces = Named(partial(read, wrenches[..., -MEANS:]), *OF_CONSTRAINTS)
        if wrenches.shape[2] > MEANS:
            pulls = partial(read, wrenches[..., :MEANS])
    error, unsure = estimate[:2]
    if error is None or unsure is None:
        error = np.empty((len(record.out.q), 2 + x.shape[1]))
        error.fill(np.nan)
        unsure = error[:, -1]
        error = error[:, :-1]
    counters: dict[str, int] = dict(zip(counted.dtype.names or (), counted.item()))
    contacts = NOTHING
    if plan.way is not None or plan.contacts or ended.log:
        contacts = _contacts(record, (t, *touched), q, pulls)
    if record.scene.touching is not None:
        from .contact_log import contact_counters

        counters |= contact_counters(record.scene)
    if record.events is not None:
        from . import event_record

        contacts = event_record.record(record.events, contacts, (q, v, vdot), rows)
        counters |= record.events.tally
        timing["events"] = record.events.seconds
    result = Result(
        mechanism=mech,
        status=ended.status,
        message=ended.message,
        t=t,
        q=q,
        v=v,
        vdot=vdot,
        states=x,
        kinetic_energy=energy[:, 0],
        potential_energy=energy[:, 1],
        work=energy[:, 2],
        dissipation=energy[:, 3],
        constraint_drift=drift,
        constraint_force=forces,
        drive_force=driven,
        contacts=contacts,
        counters=counters,
        timing=timing,
        error_at=error[rows, 0],
        state_error_at=error[rows, 1:],
        force_error_at=unsure[rows] if isinstance(rows, slice) else _of_rows(record, unsure, rows),
        space_error_at=np.full(len(t), np.nan if mech.divided else 0.0),
        header=_header(record),
        notices=(*notices(record), *estimate.notices),
        memory=record.memory or left_by(record),
        user_events=tuple(record.watch.log) if record.watch else (),
        derivatives=NO_DERIVATIVES if record.carried is None else record.carried.of_frames(rows),
    )
    if len(plan.ever):
        record.switching.add_singular(result)
    return result


def _of_drives(record: Recording, t: Array, q: Array, v: Array) -> Callable[[], dict[str, Array]]:
    """Return what computes the forces of drives at these frames, {name: (n,)}."""
    names, drives, signals = record.plan.driving, record.scene.drives, record.scene.loads.signals
    knots = drives.knots.copy()  # a stepper goes on to set its inputs
    return lambda: dict(zip(names, drive_forces(drives._replace(knots=knots), signals, t, q, v).T))


def _kept(record: Recording) -> tuple[slice | Ints, Array, Frames]:
    """Return the indices, times and frames of the result: the requested ones, and the last one of a
    run that ended early. Later runs do not change them."""
    rows: slice | Ints = slice(0, record.steps.recorded)
    if record.plan.shown is not None:
        some = record.plan.shown[: record.steps.recorded].copy()
        some[-1:] |= record.ended.over
        rows = rows if some.all() else np.flatnonzero(some)
    t, out = record.steps.times[rows], record.out
    if len(t) < len(out.q):
        out = Frames(*[a[rows] if len(a) else a for a in out])
        if not isinstance(rows, slice):
            for name in ("mean_force", "mean_torque") if out.pairs.size else ():
                out.pairs[name] = _of_rows(record, record.out.pairs[name], rows)
            out.wrenches[..., MEANS:] = _of_rows(record, record.out.wrenches[..., MEANS:], rows)
    if record.reused:
        t, out = t.copy(), Frames(*map(np.copy, out))
    return rows, t, out


def _of_rows(record: Recording, values: Array, rows: Ints) -> Array:
    """Return the forces of the result's frames, which time stepping averages over all between."""
    if not record.plan.method.time_stepping:
        return values[rows]
    return means_between(record.steps.times, values, rows)


def _header(record: Recording) -> dict[str, Any]:
    header = {**record.plan.header, "model_hash": record.mech.packed.model.hash}
    if record.met:
        header["began"] = record.met
    own = record.user is not None and record.tau is not record.plan.tau
    if own or (record.tau is not None and record.user is None and np.any(record.tau)):
        header["given_torques"] = True  # files do not store them
    return header


def _contacts(
    record: Recording,
    frames: tuple[Array, Array, Array, Array],
    q: Array,
    pulls: Callable[[], dict[str, Array]],
) -> ContactRecord:
    log = tuple(record.ended.log)
    from .contact_log import contacts_of

    given = record.mech, record.plan, frames, q, record.changes, log
    return ContactRecord.later(lambda: contacts_of(*given, pulls()))


def told(record: Recording) -> tuple[str, ...]:
    """Return notices about the model, the start and the end of a run."""
    plan = record.plan
    wide = too_wide(record) if plan.too_wide else ()
    return (*plan.notices, *wide, *plan.told, *record.ended.notices)


def notices(record: Recording) -> tuple[str, ...]:
    """Return all notices about a run up to now."""
    found = [*told(record)]
    if record.plan.method.implicit:
        found += record.steps.notices()
    if record.scene.rubs:
        found += creeping(record)
    scene, plan = record.scene, record.plan
    if scene.touching is not None or plan.idle is not None or record.events is not None:
        found += touching(record, record.unlogged)
    if record.plan.driving and (record.user or np.count_nonzero(record.scene.given)):
        found += beyond_limits(record)
    model = record.mech.packed.model
    if model.rated:
        found += too_fast(record)
    if model.following:
        found += off_track(record)
    if model.relating:
        found += off_curve(record)
    if model.riding:
        found += on_curves(record)
    if plan.wrapped:
        found += [*pierced(record), *slipped(record)]
    if plan.ranged:
        found += jumped(record)
    if model.cabled:
        found += on_wheels(record)
        found += pushing(record)
    if model.cams and len(plan.ever):
        found += lifted(record)
    if record.user is not None:
        found += [*record.user.notices(), *remembering(record.user, record.whole)]
    if record.carried is not None:
        found += record.carried.notices(record.steps.recorded)
    return tuple(found)

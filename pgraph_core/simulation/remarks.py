"""Notices about a run whose numbers may mislead its reader."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..dynamics.arguments import UserTorque, answer_of, positions
from ..dynamics.exerted import force_sizes
from ..engine import motion
from ..engine.compiler.jit import made_by_numba
from ..engine.records import CREEP, RIGID, SOFT
from ..errors import InputError, choices, percent
from ..functions import Curve
from ..joints import SIZE
from ..model.doubts import MOST_ANGLE, in_degrees, several_turns
from ..packing import Array, Ints, joint_coordinates, row_of_velocity
from ..packing.forces import acting_on
from ..packing.signals import limits_of
from ..tolerances import EPS, NAMED, NOTABLE, ROUNDING, SOLVED, VISIBLE
from .event_record import pushes
from .rates import fastest_rate, fastest_swings
from .remedies import more_accurate
from .run_plan import RunPlan
from .running import Running

if TYPE_CHECKING:
    from .monitors import Watch

FRAMES_BETWEEN = 32  # frames between two in one round of the search for a hit
LOOKS_AGAIN = 3  # rounds of that search, for hits 32**3 times shorter than frames are apart
COARSE = "frames are too coarse for the contact forces"
MANY = "give more frames=, or t_eval= with many times around a hit"


def remarks(record: Running) -> Iterator[str]:
    """Yield the notices about a run that reached its end."""
    if not (np.count_nonzero(record.out.v) or np.count_nonzero(record.out.vdot)):
        yield from at_rest(record)
    plan = record.plan
    if plan.contacts is None:
        yield from pulses(record)
    elif plan.method.starts:
        yield from hits_unseen(record)
    if record.watch is not None:
        yield from zero_at_first(record, record.watch)
    q = record.began[0]
    if q.dot(q) >= MOST_ANGLE**2:
        yield from degrees(record)


def at_rest(record: Running) -> Iterator[str]:
    """Yield a notice if gravity acts but moves no joint in any configuration."""
    mech, model = record.mech, record.mech.model
    held = len(record.plan.ever) or record.plan.contacts is not None
    acted = record.tau is not None or len(model.forces) or record.plan.header["forces"]
    if held or acted or not mech.nv or not any(model.gravity):
        return
    rng = np.random.default_rng(0)
    still, q = np.zeros(mech.nv), record.q[: mech.nq].copy()  # without states of controls
    for joint in mech.joints.values():
        if joint.q.stop - joint.q.start == joint.v.stop - joint.v.start:
            q[joint.q] += rng.uniform(0.5, 2.5, joint.q.stop - joint.q.start)
    if not mech.bias_force(q, still).any():
        why = "gravity does not move any joint, for example if all hinges are about the "
        why += "vertical; check the axes of the joints"
        if not any(b.mass for b in model.bodies):
            why = "no body has mass"
        yield f"nothing moves: {why}"


def degrees(record: Running) -> Iterator[str]:
    """Yield notices for hinges that start as if in degrees, unless the model's own does."""
    mech, q = record.mech, record.began[0]
    home = mech.home()[0]
    for name, joint in mech.joints.items():
        k = joint.q.start
        hinge = [m.facts.pivots for m in mech.model.body(name).sequence] == [True]
        if hinge and in_degrees(float(q[k])) and q[k] != home[k]:
            yield f"q of '{name}': {several_turns(float(q[k]))}"


def pulses(record: Running) -> Iterator[str]:
    """Yield a notice if accelerations change at a frame without affecting the velocities.

    A pulse between the evaluations of a step is passed over by any method. Frames are
    evaluated too. Accelerations below NOTABLE of the largest one of the same unit are errors of a
    coordinate that does not move, as are those below the rounding of all, and of forces that
    cancel.
    """
    n, plan = record.steps.recorded, record.plan
    if plan.contact_points or plan.stops or n < 6 or record.steps.counters["steps"] >= n:
        return
    nv, t = record.mech.nv, record.steps.times[:n, None]
    v, vdot = record.out.v[:n, :nv], record.out.vdot[:n, :nv]
    rate = np.diff(v, axis=0) / np.diff(t, axis=0)
    around = 0.5 * (rate[:-3] + rate[3:])  # neighbours of frames 2 to n - 3
    felt = np.maximum(np.abs(rate[1:-2] - around), np.abs(rate[2:-1] - around))
    acts = np.abs(vdot[2:-2] - around)
    slides = record.mech.packed.slides
    largest = np.abs(vdot).max(axis=0)
    whole = np.where(slides, largest[slides].max(initial=0.0), largest[~slides].max(initial=0.0))
    arm = np.where(slides, 1.0, record.mech.packed.length)  # lever arm [m]
    rounding = EPS * float((largest * arm).max(initial=0.0))
    sized = acts > np.maximum(NAMED * largest, NOTABLE * whole)
    sized &= acts * arm > rounding
    if plan.tolerance is not None:  # a pulse between two neighbours of a frame, until the end
        moved = acts * arm * (t[3:-1] - t[1:-3]) * (t[-1] - t[2:-2])
        sized &= moved > plan.tolerance.rtol * record.mech.packed.length
    missed = sized & (felt < VISIBLE * acts)
    if missed.any():
        k, j = (int(x[0]) for x in np.nonzero(missed))
        if acts[k, j] <= ROUNDING * _acceleration_sizes(record, 2 + k)[j]:
            return
        row = row_of_velocity(record.mech.packed.system.rows, j)
        unit = "m" if slides[j] else "rad"
        what = "a force" if record.user is None else "the torque function"
        yield (
            f"at t = {float(t[2 + k, 0]):.6g} s {what} has a pulse shorter than the steps, and was "
            f"missed: the acceleration of '{record.mech.packed.body_of(row)}' is "
            f"{acts[k, j]:.3g} {unit}/s^2 beside the change of its velocity; use a step= shorter "
            "than the pulse"
        )


def _acceleration_sizes(record: Running, i: int) -> Array:
    """Return the scale (nv,) of the rounding errors of accelerations at frame i, for which all
    forces add up."""
    packed, q, v = record.mech.packed, record.out.q[i].copy(), record.out.v[i].copy()
    sizes = force_sizes(packed, record.plan.acting, q, v) + np.abs(record.scene.given[: packed.nv])
    return np.abs(np.linalg.pinv(record.mech.mass_matrix(q[: packed.nq]))) @ sizes


def hits_unseen(record: Running) -> Iterator[str]:
    """Yield a notice if the peak of a soft or penalty contact force lies between frames and exceeds
    those at frames by more than NAMED.

    Where a force may change between frames, the run is repeated with more frames there, LOOKS_AGAIN
    times at most. A torque function that may remember its calls is not called again. Frames of time
    stepping contain mean forces.
    """
    plan, tau, other = record.plan, record.tau, record
    jumps = plan.impulses or plan.stops or plan.conditions or plan.contact_points
    if jumps:
        return
    again = not callable(tau) or hasattr(tau, "acting") or made_by_numba(tau)
    for _ in range(LOOKS_AGAIN):
        near = _changing(other)
        finer = _between(other, near) if near.any() else other.planned
        if len(finer.times) <= other.steps.recorded:
            break
        if not again:
            yield f"{COARSE}, which change much between them, so that they may miss peaks: {MANY}"
            return
        other = other.repeated(finer)
        if not other.ended.ok or other.steps.recorded < len(finer.times):
            return
    if other is not record:
        yield from _peaks(record, other)


def _changing(record: Running) -> Any:
    """Return a mask (n - 1,) of pairs of frames between which a force may hide, and their
    neighbours.

    The force M Δv / h that the velocities show between two frames is compared with the mean of M v'
    at both. If a force changes smoothly, they differ by f'' h² / 12, and frames miss at most
    f'' h² / 8 of a peak. It may hide where that is NAMED**1.5 of the largest force of its unit, in
    at most FRAMES_BETWEEN places.
    """
    mech, n, nv = record.mech, record.steps.recorded, record.mech.nv
    share = np.zeros(max(n - 1, 0))
    if n < 3:
        return share > 0.0
    (q, v), vdot = _motion(record, n), record.out.vdot[:n, :nv]
    h = np.diff(record.steps.times[:n])[:, None]
    hidden = np.diff(v, axis=0) / h - 0.5 * (vdot[:-1] + vdot[1:])
    with suppress(InputError):  # a diverged state may lack orientations
        inertia = mech.mass_matrix(q)
        shown = np.abs(np.einsum("nij,nj->ni", inertia, vdot))
        missed = 1.5 * np.abs(np.einsum("nij,nj->ni", inertia[:-1], hidden))
        slides = mech.packed.slides
        for same in (slides, ~slides):
            peak = shown[:, same].max(initial=0.0)
            share = np.maximum(share, missed[:, same].max(axis=1, initial=0.0) / (peak or 1.0))
    near = share > NAMED**1.5
    near[np.argsort(share)[:-FRAMES_BETWEEN]] = False
    near[1:] |= near[:-1].copy()
    near[:-1] |= near[1:].copy()
    return near


def _between(record: Running, near: Any) -> RunPlan:
    """Return the plan of a run with more frames between those that a mask (n - 1,) selects."""
    plan, n = record.planned, record.steps.recorded
    fixed = plan.tolerance is None
    parts = np.ones(n - 1, dtype=np.int64)
    parts[near] = plan.substeps[: n - 1][near] if fixed else FRAMES_BETWEEN
    ends = np.append(0, np.cumsum(parts))
    times = np.interp(np.arange(ends[-1] + 1), ends, record.steps.times[:n])
    steps: Any = {}
    if fixed:
        steps["substeps"] = np.repeat(plan.substeps[: n - 1] // parts, parts)
        steps["width"] = np.repeat(plan.width[: n - 1], parts)
    return replace(plan, times=times, shown=None, **steps)


def _peaks(record: Running, other: Running) -> Iterator[str]:
    """Yield a notice about the contact whose peak the frames miss most, by those of another run."""
    assert record.plan.contacts is not None, "only contacts have such peaks"
    touches = record.plan.contacts.touches
    if not touches:
        return
    ours, theirs = (
        np.linalg.norm(x.out.pairs["force"][: x.steps.recorded, : len(touches)], axis=2)
        for x in (record, other)
    )
    peaks, reached = ours.max(axis=0), theirs.max(axis=0)
    lack = np.where(reached > NAMED * reached.max(), reached - (1.0 + NAMED) * peaks, 0.0)
    j = int(lack.argmax())
    if lack[j] > 0.0:
        when = float(other.steps.times[int(theirs[:, j].argmax())])
        yield (
            f"{COARSE} of '{touches[j].contact.name}': the largest is {reached[j]:.4g} N at t = "
            f"{when:.6g} s, and {peaks[j]:.4g} N at frames; {MANY}"
        )


def remembering(user: UserTorque | None, repeat: bool) -> Iterator[str]:
    """Yield a notice if a torque function in Python remembers its calls.

    Steps call it at each of their stages, and steps of a method's own choice at times that they
    give up again. If `repeat` is given, calls are repeated where no change of a variable is seen.
    """
    if user is None or not user.interpreted or not user.calls.count:
        return
    why, t = "", None
    if name := user.calls.changed():
        why = f"changes '{name}' from call to call, as one that remembers its calls does"
    elif repeat and (t := user.calls.differs(partial(answer_of, user.function))) is not None:
        why = f"gives another answer when its call at t = {t:.6g} s is repeated, so it remembers "
        why += "earlier calls or is random"
    if why:
        yield (
            f"the torque function {why}. It is called at every stage of every step, also ahead and "
            "back in time: give sample=0.01, for example, with which it is called once at each "
            "multiple of 0.01 s, and its torques are held in between"
        )


def zero_at_first(record: Running, watch: Watch) -> Iterator[str]:
    """Yield a notice for each user event whose value is zero until it leaves zero in some frame."""
    n = record.steps.recorded
    for monitor in watch.monitors[watch.waiting :]:
        q, v = _motion(record, n)
        i = 0
        while i < n and monitor(float(record.steps.times[i]), q[i], v[i]) == 0.0:
            i += 1
        if 1 < i < n:
            yield (
                f"the event '{monitor.name}' is zero from the start to t = "
                f"{record.steps.times[i - 1]:.6g} s, and leaving zero is not an event: let the "
                "function have a sign there, such as q[0] - 1 in place of max(q[0] - 1, 0)"
            )


def turns_unseen(record: Running, frames: tuple[Array, Array, Array, Array]) -> Iterator[str]:
    """Yield a notice about bodies whose motion reverses between frames."""
    from ..result.dense import TOO_WIDE, unseen

    packed, steps = record.mech.packed, int(record.steps.counters["steps"])
    rows = unseen(packed.system.rows, frames, packed.length)
    if not rows:
        return
    names = list(dict.fromkeys(f"'{packed.body_of(row)}'" for row in rows))
    text = f"{TOO_WIDE} for the motion of {choices(names, 3)}, which reverses between two of "
    text += f"them: curves, ranges and peaks may miss it; give frames={steps + 1}, one per step"
    yield text


def beyond_limits(record: Running) -> Iterator[str]:
    """Yield a notice about the joint whose given torque exceeds the limits of its motors most.

    Drives of a sum of coordinates limit no coordinate alone.
    """
    nv, drives, user = record.mech.nv, record.scene.drives, record.user
    most = np.abs(record.scene.given[:nv]) if user is None else user.most
    if most is None or not most.any():
        return
    limits, names = np.zeros(nv), dict[int, str]()
    each = limits_of(drives.table, record.scene.loads.signals[0])[drives.passive :]
    for one, limit, name in zip(drives.table[drives.passive :], each, record.plan.driving):
        own, factors = acting_on(drives, one)
        if len(own) == 1:
            j = int(own[0])
            limits[j] += np.abs(factors[0] * limit).max()
            names[j] = f"{names[j]}, '{name}'" if j in names else f"'{name}'"
    beyond = {j: most[j] / limits[j] for j in names if most[j] > limits[j]}
    if not beyond:
        return
    j = max(beyond, key=lambda j: beyond[j])
    unit = "N" if record.mech.packed.slides[j] else "N m"
    body = record.mech.packed.body_of(row_of_velocity(record.mech.packed.rows, j))
    yield (
        f"tau asks for up to {most[j]:.3g} {unit} in the joint of '{body}', more than the "
        f"{limits[j]:.3g} {unit} of its motors ({names[j]}): tau is added to motors, and no limit "
        "of theirs applies to it; clip it, or give it to a motor as torque="
    )


def too_fast(record: Running) -> Iterator[str]:
    """Yield a notice about the joint that exceeds its speed limit most, in the frames."""
    mech, n, worst = record.mech, record.steps.recorded, 1.0
    text, names = "", list[str]()
    for body in mech.model.rated if n else ():
        sizes = [SIZE[m.kind][1] for m in body.sequence]
        limits = np.repeat(body.speed_limit, sizes)
        own = np.arange(mech.joints[body.name].v.start, mech.joints[body.name].v.stop)[limits > 0.0]
        shares = np.abs(record.out.v[:n, own]) / limits[limits > 0.0]
        i, k = (int(x) for x in np.unravel_index(np.argmax(shares), shares.shape))
        if shares[i, k] <= 1.0 + SOLVED:
            continue
        names.append(f"'{body.name}'")
        if shares[i, k] > worst:
            worst = shares[i, k]
            limit = float(limits[limits > 0.0][k])
            unit = "m/s" if mech.packed.slides[own[k]] else "rad/s"
            text = (
                f"the joint of '{body.name}' reaches {worst * limit:.4g} {unit} at t = "
                f"{record.steps.times[i]:.6g} s, more than its speed_limit of {limit:.4g} {unit}"
            )
    if len(names) > 1:
        text += f"; those of {choices(names, 6)} exceed theirs"
    if text:
        yield text


def off_track(record: Running) -> Iterator[str]:
    """Yield a notice about the first body that goes past an end of its track, in the frames."""
    mech, n, first = record.mech, record.steps.recorded, None
    for body in mech.model.following if n else ():
        assert body.track is not None, "it follows one"
        place = [m.track is None for m in body.sequence].index(False)
        at = mech.joints[body.name].q.start + sum(SIZE[m.kind][0] for m in body.sequence[:place])
        low, high = body.track.pieces.x[[0, -1]].tolist()
        slack = NOTABLE * (high - low)
        beyond = (record.out.q[:n, at] < low - slack) | (record.out.q[:n, at] > high + slack)
        i = int(np.argmax(beyond)) if beyond.any() else n
        if i < (n if first is None else first[0]):
            first = i, body.name, low, high, body.track.unit
    if first is not None:
        i, name, low, high, unit = first
        yield (
            f"'{name}' is past the end of its track at t = {record.steps.times[i]:.6g} s: the "
            f"track goes from {low:.6g} to {high:.6g} {unit}, and is continued with "
            "constant second derivatives; make it longer, or hold the body by a spring"
        )


def off_curve(record: Running) -> Iterator[str]:
    """Yield a notice about the first relation that goes past an end of its curve, in the frames."""
    mech, n, first = record.mech, record.steps.recorded, None
    held = {mech.model.constraints[i].name for i in record.plan.ever.tolist()}
    for c in mech.model.relating if n else ():
        if c.name not in held:
            continue
        assert isinstance(c.curve, Curve), "it has points"
        assert c.curve.ends is not None, "it has ends"
        low, high = c.curve.ends
        number = mech.topology.number(c.other)
        at = joint_coordinates(mech.packed.system, number)[c.other_coordinate][1]
        slack = NOTABLE * (high - low)
        beyond = (record.out.q[:n, at] < low - slack) | (record.out.q[:n, at] > high + slack)
        i = int(np.argmax(beyond)) if beyond.any() else n
        if i < (n if first is None else first[0]):
            first = i, c, low, high
    if first is not None:
        i, c, low, high = first
        yield (
            f"relation '{c.name}' is past an end of its curve at t = {record.steps.times[i]:.6g} s:"
            f" the points go from {low:.6g} to {high:.6g}, and a straight line goes on; give more "
            "points, or kind='periodic' or 'quintic' if the curve repeats or rests there"
        )


def creeping(record: Running) -> Iterator[str]:
    """Yield a notice about the joint that moves farthest while its friction should hold it."""
    mech, n = record.mech, record.steps.recorded
    t = record.steps.times[:n]
    (q, v), system, drives = _motion(record, n), mech.packed.system, record.scene.drives
    worst, text = NOTABLE, ""
    with suppress(InputError, np.linalg.LinAlgError):  # a diverged state may lack orientations
        mobility = np.array([np.linalg.inv(mech.mass_matrix(x)) for x in q])
        for one in drives.table[drives.table["friction"] > 0.0]:
            own, factors = acting_on(drives, one)
            slides = mech.packed.slides[own[0]]
            unit, length = ("m", mech.packed.length or 1.0) if slides else ("rad", 1.0)
            braking = one["friction"] * (mobility[:, own][:, :, own] @ factors @ factors)
            speed = v[:, own] @ factors
            held = sticking(t, speed, braking, float(one["creep"]))
            way = _way(t, speed, held)
            if way > worst * length and (record.user is None or not record.user.interpreted):
                held[held] = (
                    np.abs(_pulls(record, np.flatnonzero(held), own, factors)) <= braking[held]
                )
                way = _way(t, speed, held)
            if way > worst * length:
                body = mech.packed.body_of(row_of_velocity(system.rows, int(own[0])))
                worst = way / length
                text = (
                    f"the joint of '{body}' creeps by {way:.3g} {unit}, although its friction "
                    "should hold it, because this method regularises friction at speeds of about "
                    f"{CREEP:g} {unit}/s; use method 'moreau_jean' without rtol for sticking"
                )
    if text:
        yield text


def _way(t: Array, v: Array, held: Any) -> float:
    """Compute the distance covered between frames that are both held [m, rad]."""
    way = 0.5 * (np.abs(v[:-1]) + np.abs(v[1:])) * np.diff(t)
    return float(way[held[:-1] & held[1:]].sum())


def _pulls(record: Running, frames: Ints, own: Ints, factors: Array) -> Array:
    """Compute the accelerations of a drive, if it were at rest, at these frames."""
    scene, out, t = record.scene, record.out, record.steps.times
    found, wrenches = np.zeros(len(frames)), np.empty_like(out.wrenches[0])
    for i, n in enumerate(frames.tolist()):
        q, v = out.q[n].copy(), out.v[n].copy()
        v[own] -= factors * (factors @ v[own] / (factors @ factors))
        vdot = np.zeros(len(v))
        motion.constrained_dynamics(
            scene.address, scene.accelerate, float(t[n]), q, v, scene.given, np.zeros(3), vdot,
            wrenches,
        )  # fmt: skip
        found[i] = vdot[own] @ factors
    return found


def touching(record: Running, unlogged: int) -> Iterator[str]:
    """Yield notices about contacts, given the number of phase changes that are not in the log."""
    mech, tables, last = record.mech, record.plan.contacts, record.steps.recorded - 1
    n = 0 if record.scene.touching is None or tables is None else _oriented(record)
    if n and tables is not None:
        from .contact_log import contact_notices
        from .overpowered import overpowering

        (q, v), t, pairs = _motion(record, n), record.steps.times[:n], record.out.pairs[:n]
        frames = t, q, pairs["gap"]
        whole = t, record.out.q[:n], record.out.v[:n]
        strong = overpowering(mech, record.scene, record.plan, whole)
        given = record.scene, unlogged, tables, record.active, frames, strong
        yield from contact_notices(mech, *given)
        if tables.touches:
            from .shared_loads import of_steps

            yield from of_steps(mech, tables, record.active, (t, q, v), pairs).notices()
    if record.events is not None and (n := _oriented(record)):
        from .shared_loads import of_events

        frames = record.steps.times[:n], *_motion(record, n)
        yield from of_events(mech, record.events.scene, record.active, frames).notices()
    idle = record.plan.idle
    if idle is not None and last >= 0 and idle.below(record.scene, record.out.q[last]):
        from .overpowered import sunk_through

        q, _ = _motion(record, last + 1)
        yield from sunk_through(mech, idle, record.began[0][: mech.nq], q[-1])


def _motion(record: Running, n: int) -> tuple[Array, Array]:
    """Return q (n, nq) and v (n, nv) of the first frames, without the states of controls."""
    q, v = record.out.q[:n, : record.mech.nq], record.out.v[:n, : record.mech.nv]
    return np.ascontiguousarray(q), np.ascontiguousarray(v)


def _oriented(record: Running) -> int:
    """Count the frames with valid orientations, which a diverged state may lack."""
    count = record.steps.recorded
    if record.ended.ok and count > 1:  # a stepper has one that nobody may have recorded
        return count
    for n in range(count, 0, -1):
        with suppress(InputError):
            positions(record.mech.packed, record.out.q[n - 1 : n])
            return n
    return 0


def sticking(t: Array, v: Array, braking: Array, creep: float) -> Any:
    """Return a mask of the frames (n,) at which a joint would be at rest by Coulomb's law.

    `t` (n,) and `v` (n,) are the times and speeds of the frames, and `braking` (n,) is the
    deceleration by the whole friction. The speed by Coulomb's law under the same load is less by
    the impulse that regularised friction lacks. Between frames the speed is linear.
    """
    size = np.abs(v)
    root, turns = np.hypot(v, creep), v[:-1] * v[1:] < 0.0
    sums = size[:-1] + size[1:]
    share = sums / (root[:-1] + root[1:])  # mean of |v| / √(v² + creep²)
    share[turns] = ((root[:-1] + root[1:] - 2.0 * creep)[turns]) / sums[turns]
    change = np.where(turns, size[1:], np.diff(size))
    change -= np.diff(t) * 0.5 * (braking[:-1] + braking[1:]) * (1.0 - share)
    speeds = size[:1].tolist()
    for more, turned in zip(change.tolist(), turns.tolist()):
        speeds.append(max(0.0, more if turned else speeds[-1] + more))
    return np.array(speeds) == 0.0


# -- forces and vibrations -------------------------------------------------------------------------


def unsure_forces(record: Running, t: Array, error: Array) -> tuple[str, ...]:
    """Return a message about errors (n,) of contact and limit forces that are a notable part of
    their peak, and more than the rounding of gaps."""
    peak = float(np.abs(record.out.pairs["mean_force"][: len(t)]).max(initial=0.0))
    if record.events is not None:
        peak = max(peak, float(np.abs(pushes(record.events.scene, slice(len(t)))).max(initial=0.0)))
    worst = float(error.max(initial=0.0))
    if not worst > max(NAMED * peak, _of_rounding(record)):
        return ()
    share = (
        f"{percent(worst / peak)} of their peak, and above 10 %"
        if peak
        else "which acts only in a finer run,"
    )
    return (
        f"the error of contact and limit forces is about {worst:.2g} N or N m, {share} "
        f"from t = {t[int((error > NAMED * peak).argmax())]:.4g} s on; use "
        f"{more_accurate(record.plan)}",
    )


def unsure_speeds(
    record: Running, finer: Running, t: Array, common: tuple[Ints, Ints], size: float
) -> tuple[str, ...]:
    """Return a message about errors of angular or linear speeds that are a notable part of the
    largest one, and of what moves through the `size` of the motion during the run.

    They are the differences from the `finer` run, at the `common` frames of both among t (n,).
    """
    nv, n, slides, (i, j) = record.mech.nv, len(t), record.mech.packed.slides, common
    speeds = np.abs(record.out.v[:n, :nv])
    off = np.abs(record.out.v[i, :nv] - finer.out.v[j, :nv])
    for way, unit in ((~slides, "rad/s"), (slides, "m/s")):
        own, peak = off[:, way].max(axis=1, initial=0.0), float(speeds[:, way].max(initial=0.0))
        worst = float(own.max(initial=0.0))
        if worst > NAMED * peak and worst * abs(t[-1] - t[0]) > VISIBLE * size:
            share = f"{percent(worst / peak)} of the largest" if peak else "while nothing moves"
            return (
                f"the error of speeds is about {worst:.2g} {unit}, {share}, and above 10 % from "
                f"t = {t[i[int((own > NAMED * peak).argmax())]]:.4g} s on; use "
                f"{more_accurate(record.plan)}",
            )
    return ()


def _of_rounding(record: Running) -> float:
    """Return the largest force by which a soft or penalty contact answers rounding [N].

    A gap is a sum of about 16 products, each with the rounding of the mechanism's length.
    """
    tables = record.plan.contacts
    if tables is None or not tables.compliant:
        return 0.0
    depth = 16.0 * EPS * record.plan.length
    laws = tables.laws
    power = np.where(laws["law"] == SOFT, 1.5, 1.0)
    return float((laws["stiffness"] * depth**power)[laws["law"] != RIGID].max(initial=0.0))


def passed_over(record: Running, error: float) -> tuple[str, ...]:
    """Return a message about vibrations that implicit steps damp out at any size, if they may
    matter.

    They are missing from both runs. The energy that the ledger misses bounds their amplitude.
    """
    plan, step, n = record.plan, record.plan.step, record.steps.recorded
    if step is None or plan.method.limit or record.steps.divided:
        return ()
    acts = (record.mech, (plan.drives, plan.loads), plan.active, *record.began)
    rate = fastest_rate(*acts)
    if rate * step <= 1.0 or not fastest_swings(*acts):
        return ()
    kinetic, potential, work, lost = record.out.energies[:n].T
    balance = kinetic + potential - work + lost
    inertia = np.diag(record.mech.mass_matrix(record.began[0]))
    most = float(np.sqrt(2.0 * np.ptp(balance) / inertia[inertia > 0.0]).max(initial=0.0)) / rate
    if most <= error:
        return ()
    return (
        f"the error excludes vibrations of {rate:.3g} rad/s, which {plan.method.name} damps "
        f"with steps of {step:.3g} s (up to {most:.2g} rad or m). To resolve them, use a "
        f"step below {1.0 / rate:.2g} s",
    )

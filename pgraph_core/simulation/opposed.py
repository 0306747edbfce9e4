"""Contacts and limits that give way because constraints drive bodies against them, named."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..analysis.singular import holding
from ..contact.points import ContactPoint
from ..contact.tables import ContactPair, Tables
from ..engine import layout as at
from ..engine.contact.meeting import SIZE
from ..mechanism import Mechanism
from ..model.fields import EVERY, GROUND
from ..packing.system import Array, Ints

BEYOND = 1e-2  # of a limit's range: a coordinate that has passed it
SUNK = 0.5  # of the size of what touches: deeper than a soft contact means
LISTED = 3


def limits_passed(mech: Mechanism, tables: Tables, active: Ints, t: Array, q: Array) -> list[str]:
    """A notice for each limit that a coordinate has passed at the states q (n, nq)."""
    ints, floats, terms, signs = tables.limit_blocks
    found = []
    for name, block, values in zip(tables.limits, ints, floats):
        term = int(block[at.B_TERM])
        v, place = terms[term].tolist()
        gap = signs[term] * q[:, place] - values[at.VALUE]
        passed = np.flatnonzero(gap < -BEYOND * values[SIZE])
        if len(passed):
            i, deepest = int(passed[0]), float(-gap.min())
            way = signs[term] * np.eye(mech.nv)[v]
            by = _by(holding(mech, active, float(t[i]), q[i], way), _of(mech, v), f"limit '{name}'")
            text = (
                f"at t = {t[i]:.6g} s limit '{name}' is passed, by up to {deepest:.3g} rad or m: "
            )
            found.append(text + (by or "a smaller step, or a start within it, would do"))
    return found


def sunk(
    mech: Mechanism, tables: Tables, active: Ints, t: Array, q: Array, gap: Array
) -> list[str]:
    """A notice for each soft or penalty contact that is deeper than its law means at (t, q)."""
    shapes, found = tables.geometry.shapes, []
    for k, pair in enumerate(tables.touches):
        if pair.contact.law == "complementarity" or EVERY in pair[1:3]:
            continue
        numbers = [mech.topology.number(name) for name in pair[1:3] if name != GROUND]
        size = min(float(shapes["reach"][shapes["body"] == n].max(initial=0.0)) for n in numbers)
        deepest = int(np.argmin(gap[:, k]))
        if size > 0.0 and -gap[deepest, k] > SUNK * size:
            when = float(t[deepest])
            why = driven_into(mech, active, pair, t, q, when)
            found.append(
                f"at t = {when:.6g} s contact '{pair.name}' is {-gap[deepest, k]:.3g} m deep, "
                f"{-gap[deepest, k] / size:.2g} of the size of what touches, beyond what its law "
                f"means; {why or 'give it more stiffness, or start without overlap'}"
            )
    return found


def driven_into(
    mech: Mechanism, active: Ints, pair: ContactPair, t: Array, q: Array, when: float
) -> str:
    """Why the two of a contact are inside each other; "" where no constraint drives them there."""
    if EVERY in pair[1:3]:
        return ""
    i = min(int(np.searchsorted(t, when)), len(t) - 1)
    normal = np.array(mech.model.ground_normal)
    way = mech.jacobian(q[i], pair.body)[3:]
    if pair.other != GROUND:
        way = way - mech.jacobian(q[i], pair.other)[3:]
        apart = mech.pose(q[i], pair.body)[0] - mech.pose(q[i], pair.other)[0]
        size = float(np.linalg.norm(apart))
        normal = apart / size if size else normal
    return _by(
        holding(mech, active, float(t[i]), q[i], way.T @ normal),
        pair.body,
        f"contact '{pair.name}'",
    )


def contradicted(
    mech: Mechanism, active: Ints, points: Sequence[ContactPoint], t: float, q: Array
) -> str:
    """A sentence on the closed contact points and limits that constraints drive bodies against."""
    found: dict[str, str] = {}
    for p in points:
        if p.limit is not None:
            way, what = p.limit.sign * np.eye(mech.nv)[p.limit.at_v], f"limit '{p.name}'"
        else:
            normal = np.array(mech.model.ground_normal)
            way, what = mech.jacobian(q, p.body, p.point)[3:].T @ normal, f"contact '{p.pair}'"
        if names := holding(mech, active, t, q, way):
            found[what] = _by(names, p.body, what)
    return "; ".join(list(found.values())[:LISTED])


def _of(mech: Mechanism, v: int) -> str:
    """The body whose joint has this degree of freedom."""
    return next(name for name, joint in mech.joints.items() if joint.v.start <= v < joint.v.stop)


def _by(names: Sequence[str], body: str, what: str) -> str:
    if not names:
        return ""
    drive = "constraint {} drives" if len(names) == 1 else "constraints {} drive"
    named = " and ".join(f"'{name}'" for name in names[:LISTED])
    return (
        f"{drive.format(named)} '{body}' against {what}, and neither gives way: change one of them"
    )

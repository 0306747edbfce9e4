"""The method of a run: the one asked for, or the one that suits the scene."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.arrays import Drives
from ..integrators import DOP853, DOPRI5, RADAU5, RK4, Method, method_of
from ..mechanism import Mechanism
from ..mechanism.packed import NO_LOADS
from .acting import Acting
from .stiffness import fastest_rate

MANY = 1e5  # radians of the fastest oscillation in a run: more are not worth resolving
NO_FORCES = (Drives(np.zeros((0, at.DRIVE)), np.zeros((0, 3)), 0), NO_LOADS)


class Choice(NamedTuple):
    """The method of a run."""

    method: Method
    why: str
    rate: float  # the fastest one [1/s]; 0 where nothing needs it or torques are not known
    looked: float  # time spent on it [s]


def chosen(
    mech: Mechanism, acts: Acting, name: str, step: float | None, rtol: float | None, span: float
) -> Choice:
    """The method called `name`, or for "auto" the one that suits. Raises InputError."""
    asked = None
    if name != "auto" or (acts.impulses and rtol is None):
        known = "moreau_jean" if name == "auto" else name
        asked = method_of(known, impulses=acts.impulses, touching=acts.contacts is not None)
    rate, looking = 0.0, time.perf_counter()
    start = acts.active, acts.q, acts.v
    if not callable(acts.tau) and (asked is None or not asked.implicit):
        rate = fastest_rate(mech, (acts.drives, acts.loads), *start)
    looked = time.perf_counter() - looking
    if asked is not None:
        impacts = "moreau_jean: the scene has rigid contacts or joint limits"
        return Choice(asked, impacts if name == "auto" else f"{name}: as asked", rate, looked)
    if acts.impulses:
        return Choice(*from_event_to_event(rtol), rate, looked)
    rest = fastest_rate(mech, NO_FORCES, *start) if rate * span > MANY else rate
    touching = acts.contacts is not None
    return Choice(*automatic(step, rtol, rate, rest, span, touching), rate, looked)


def from_event_to_event(rtol: float | None) -> tuple[Method, str]:
    """The method that suits impulses to a tolerance, and why."""
    if rtol is not None and rtol > 1e-5:
        return DOPRI5, "dopri5: rigid contacts or joint limits, to a loose tolerance"
    return DOP853, "dop853: rigid contacts or joint limits, to a tight tolerance"


def automatic(
    step: float | None,
    rtol: float | None,
    rate: float,
    rest: float,
    t_end: float,
    touching: bool,
) -> tuple[Method, str]:
    """The method that suits, and why; `rate` is the fastest one, `rest` that without springs."""
    if step is not None and rtol is None:
        if rate * step > RK4.limit:
            return (
                RADAU5,
                f"radau5: the fastest rate, {rate:.3g}/s, times the step is too much for rk4",
            )
        return RK4, "rk4: the most accurate of the methods for smooth motion at a fixed step"
    if rate * t_end > MANY and rate > 30.0 * rest:
        return (
            RADAU5,
            f"radau5: springs or dampers make rates of {rate:.3g}/s, the rest {rest:.3g}/s",
        )
    if touching:
        return DOPRI5, "dopri5: soft contacts, whose forces bend, at steps of its own choice"
    if rtol is not None and rtol > 1e-5:
        return DOPRI5, "dopri5: smooth motion, to a loose tolerance"
    return DOP853, "dop853: smooth motion, to a tight tolerance, at steps of its own choice"

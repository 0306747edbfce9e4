"""RunPlan: what a run is made of, checked and complete."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..contact.sites import Site
from ..contact.tables import Tables
from ..integrators import Method
from ..system import Array, Drives, Ints, Loads
from .switching import Change, ever

NO_TIMES = np.zeros(0)
FIXED_RTOL = 1e-9  # what implicit methods solve their equations to where steps are given


class Tolerance(NamedTuple):
    """How steps are chosen."""

    rtol: float  # against the mechanism's own scales
    atol: float  # of every coordinate, in its unit
    widest: float  # largest step [s]
    most: int  # steps
    corners: Array  # (nk,) times where tables bend: steps end there [s]
    fixed: bool = False  # every step is the widest


class RunPlan(NamedTuple):
    """What a run is made of, checked and complete."""

    method: Method
    times: Array  # (frames,) [s]
    substeps: Ints  # (frames - 1,) steps between two frames, where they are given
    width: Array  # (frames - 1,) their width [s]
    drives: Drives
    loads: Loads
    active: Ints  # indices of the active constraints
    contacts: Tables | None  # what touches; None: nothing
    gains: Array  # (2,) of Baumgarte
    project: bool
    tolerance: Tolerance | None  # None: steps are given
    sites: tuple[Site, ...] = ()  # contact points and limits of an event-driven run
    changes: tuple[Change, ...] = ()  # constraints that go on and off
    kinks: Array = NO_TIMES  # corners of tables inside steps of given width [s]

    @property
    def ever(self) -> Ints:
        """Indices of the constraints that are active at some time."""
        return ever(self.active, self.changes)

    @property
    def step(self) -> float | None:
        """Width of the steps [s]; None where the method chooses them."""
        if self.tolerance is None:
            return float(np.max(self.width, initial=0.0))
        return self.tolerance.widest if self.tolerance.fixed else None

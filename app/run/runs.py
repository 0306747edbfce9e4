"""Runs on the page: their requests, and the curves and poses that they show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np

import pgraph_core as pg
from pgraph_core.fields import Number
from pgraph_core.model.settings import AUTO, OF, Settings, settings_of
from pgraph_core.numbering import children_of
from pgraph_core.show import shapes
from pgraph_core.show.bodies import Look, extent, looks

from ..core.state import of_model
from .footfalls import Change, changes

TRAVELS = 1.0  # a picture of all of a longer way shows the model at less than half its size
IN_PLACE = 8.0  # extent over the model's size above which the present picture is framed
MOMENTS, FEW = 48, 100  # moments of a run, and most bodies, for a view of all corners
FREE_RUN = ""  # the scenario of a run that has none


class Request(Settings):
    """Settings of a run, either a named scenario with its own settings or a free run with these."""

    scenario: str = FREE_RUN
    t_end: Annotated[Number, OF["t_end"]] = 2.0
    step: Annotated[Number | None, OF["step"]] = None  # the method chooses it
    method: Annotated[str, OF["method"]] = AUTO

    @classmethod
    def of(cls, scenario: pg.Scenario) -> Self:
        """Return the request for a scenario with its own settings."""
        return cls(scenario=scenario.name, **settings_of(scenario))

    def options(self, model: pg.Model) -> dict[str, Any]:
        """Return the arguments of `simulate` for a model, except for times.

        Settings equal to those of the scenario are left to it, so that the run is that of
        `simulate(model, scenario=...)`: a step of a call is the size of every step, whereas that of
        a scenario leaves the choice to an adaptive method.
        """
        named = None if self.scenario == FREE_RUN else self.scenario
        scenario = next((s for s in model.scenarios if s.name == named), None)
        held = {} if scenario is None else settings_of(scenario)
        own = {
            name: x
            for name, x in settings_of(self).items()
            if name not in self.TIMES and (name not in held or x != held[name])
        }
        return {"scenario": named, **own}

    @property
    def recorded(self) -> dict[str, Any]:
        """The arguments of `simulate` for its recorded times, except for the end."""
        times = {name: getattr(self, name) for name in self.TIMES if name != "t_end"}
        return {name: x for name, x in times.items() if x is not None}


def first_request(model: pg.Model) -> Request:
    """Return the initial request: the model's first scenario, or a free run if it has none."""
    if not model.scenarios:
        return Request()
    return Request.of(model.scenarios[0])


@of_model
def led(model: pg.Model) -> np.ndarray:
    """Return the indices of the bodies that a camera follows: the heaviest tree whose root is free.

    These are all bodies of a model without one.
    """
    top = pg.Topology.of(model)
    parent = top.parent.tolist()
    root = list(range(len(parent)))
    for k, p in enumerate(parent):  # parents have smaller numbers
        root[k] = k if p == 0 else root[p - 1]
    mass = [0.0] * len(parent)
    for k, name in enumerate(top.names):
        mass[root[k]] += model.body(name).mass
    free = [k for k in set(root) if model.body(top.names[k]).floats]
    best = max(free, key=lambda k: (mass[k], -k), default=None)
    return np.array([k for k in range(len(parent)) if best in (None, root[k])], dtype=int)


@dataclass(frozen=True)
class Run:
    """A finished simulation and its model."""

    model: pg.Model
    request: Request
    result: Any  # pgraph_core's result
    walked: tuple[Change, ...] | None = None  # changes of its feet, if known
    ended: str = ""  # end of a live run
    gait: pg.Gait | None = None  # replaces the gait of the scenario

    @cached_property
    def falls(self) -> tuple[Change, ...]:
        """The foot contact changes during the run."""
        return changes(self.result) if self.walked is None else self.walked

    @property
    def whole(self) -> pg.Model:
        """The model with the segments that the beams have in this run."""
        return self.result.mechanism.model if self.model.beams else self.model

    @cached_property
    def usual_force(self) -> float:
        """Return the largest force [N] of constraints and contacts, ignoring the shortest impacts.

        This is the 98th percentile over all frames with a force. The impact of a fall can be a
        hundred times the load of a foot, which would otherwise be invisible.
        """
        every = (*self.result.constraint_force.values(), *self.result.contact_force.values())
        peaks = [np.abs(np.asarray(wrench)[:, 3:]).max(axis=1) for wrench in every if len(wrench)]
        largest = np.max(peaks, axis=0) if peaks else np.zeros(0)
        acting = largest[(largest > 0) & np.isfinite(largest)]
        return float(np.quantile(acting, 0.98, method="higher")) if len(acting) else 0.0

    @cached_property
    def size(self) -> float:
        """Return the overall size of the drawn bodies in the first frame [m]."""
        return float(np.linalg.norm(np.ptp(self._corners(self.result.body_pose[0]), axis=0)))

    @cached_property
    def _looks(self) -> list[Look]:
        whole = self.whole
        top = pg.Topology.of(whole)
        drawn = [whole.body(name) for name in top.names]
        parent = tuple(top.parent.tolist())
        return looks(drawn, children_of(parent), shapes.branch_colors(parent))

    def _corners(self, pose: np.ndarray) -> np.ndarray:
        return extent(self._looks, pose[:, :3], shapes.to_matrix(pose[:, 3:]))

    @cached_property
    def swept(self) -> np.ndarray:
        """Return the corners (n, 3) of the bodies at MOMENTS of the run, relative to a following
        camera [m], and of more than FEW bodies their origins."""
        pose = np.asarray(self.result.body_pose)
        if not pose.size:
            return np.zeros((0, 3))
        few = pose[np.linspace(0, len(pose) - 1, MOMENTS).astype(int)]
        boxes = [p[:, :3] if len(p) > FEW else self._corners(p) for p in few]
        gone = self.travels * few[:, led(self.whole), :3].mean(axis=1)
        corners = np.concatenate([box - way for box, way in zip(boxes, gone)])
        fits = np.ptp(corners, axis=0).max() <= IN_PLACE * self.size  # False for nan
        return corners if fits else np.zeros((0, 3))

    @cached_property
    def travels(self) -> np.ndarray:
        """Return an array (3,) with 1 for each axis along which the centre of what is followed
        travels more than TRAVELS times `size`, and 0 otherwise."""
        pose = np.asarray(self.result.body_pose)
        if not pose.size:
            return np.zeros(3)
        way = np.ptp(pose[:, led(self.whole), :3].mean(axis=1), axis=0)
        return (way > TRAVELS * self.size).astype(float)

"""Constraints, contacts, forces, loops, limits, sites, outputs, controls: their tab and cells.

Labels, units and help texts are defined by the fields of the classes. This module defines the cells
of a form that show a component of a field.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import UnionType
from typing import Annotated, Any, Literal, Self, Union, get_args, get_origin

import pgraph_core as pg
from pgraph_core import fields
from pgraph_core.fields import About
from pgraph_core.model.editing import CUT
from pgraph_core.model.output import OF_JOINT, READINGS
from pgraph_core.units import UNITS

from .. import model, pose
from ..core.jobs import Finding
from ..core.state import Names
from . import cams

Part = Literal["constraints", "contacts", "forces", "sites", "outputs", "controls"]
Slot = Literal["body", "other"]


@dataclass(frozen=True)
class Picking:
    """A pending click on a body, for an existing part or as the next body of a new part."""

    part: Part | Literal["loops", "limits"]
    kind: str  # kind of the part, or of the joint of a loop
    slot: Slot = "body"
    name: str | None = None  # name of the part, None for a new one
    body: str | None = None  # picked first body of a new part
    more: tuple[str, ...] = ()  # bodies that get such a part too: what else was selected
    way: tuple[tuple[str, tuple[float, float, float] | None], ...] = ()  # bodies of a cable in
    # their order, with points that were clicked on them [m]


BY_ITSELF = 300  # degrees of freedom up to which the report comes unasked: it costs O(n³)


@dataclass(frozen=True)
class MobilityReport(Finding):
    """The remaining degrees of freedom and the redundant rows in a constrained model."""

    FIELD = "mobility"

    @staticmethod
    def wanted(state: State) -> bool:
        """Check whether constraints are on a page, whose bar shows what they leave."""
        if not state.model.constraints or not state.clients:
            return False
        return state.derived.dof <= BY_ITSELF or state.mobility_asked is state.model

    @staticmethod
    def find(model: pg.Model) -> pg.Mobility:
        return pg.Mechanism(model).mobility()


KINDS: dict[str, dict[str, str]] = {  # one line each, for who chooses
    "constraints": {kind: each.ABOUT for kind, each in pg.Constraint.KINDS.items()},
    "contacts": dict(pg.Contact.ABOUT),
    "forces": {kind: each.ABOUT for kind, each in pg.Force.KINDS.items()},
    "loops": {kind: pg.Constraint.KINDS[cut].ABOUT for kind, cut in CUT.items()},
    "limits": {"limits": "least and greatest position of a joint (unilateral)"},
    "sites": {"site": "a named frame on a body"},
    "outputs": {kind: each.about for kind, each in READINGS.items()},
    "controls": {kind: each.ABOUT for kind, each in pg.Control.KINDS.items()},
}
TITLES = {
    "constraints": "Constraint",
    "loops": "Close a loop (cut joint)",
    "contacts": "Contact (unilateral)",
    "limits": "Joint limit (unilateral)",
    "forces": "Force, motor, spring",
    "sites": "Site (named frame)",
    "outputs": "Output (sensor)",
    "controls": "Controller, filter, state",
}
WORD = {
    "constraints": "constraint", "contacts": "contact", "forces": "force", "loops": "loop",
    "sites": "site", "outputs": "output", "controls": "control",
}  # fmt: skip

CELLS = {  # cells of a form that are a part of a field, or choose how it is given
    "curve": About("Follows", "", "how the position depends on time"),
    "sine": About("Sine", "", "mean + amplitude sin(frequency t + phase)"),
    "polynomial": About("Polynomial", "", "c0 + c1 t + c2 t² + c3 t³"),
    "expression": About("Expression", "", "of t and parameters: =0.3*sin(2*t)"),
    "lift_is": About("Lift is", "", "how the lift is given"),
    "function": About("Curve is", "", "how the curve is given"),
    "table": About("Table", "", "t q; t q; ... a smooth curve through these"),
    "torque_over": About("Torque is", "", "constant, or linear between times"),
    "force_over": About("Force is", "", "constant, or linear between times"),
}


def about(item: Any, field: str) -> About:
    """Return the presentation of a field, or of one of its cells, in a form."""
    known = type(item).model_fields
    if field not in known:
        return CELLS.get(field, About(field))
    return fields.about(known[field], field)._replace(
        unit=UNITS.get(fields.dim_of(item, field), "")
    )


def typed_as(item: Any, field: str) -> tuple[str, tuple[Any, ...]]:
    """Return the type of a field's cell and its options.

    The result is ("vector", ()), ("whole", (least, greatest)), ("flag", ()), ("choice", options) or
    ("number", ()). The last is also used for cells without a field.
    """
    info = type(item).model_fields.get(field)
    for kind in _types(info.annotation) if info else ():
        if get_origin(kind) is tuple and all(
            fields.Finite in (each, *get_args(each)) for each in get_args(kind)
        ):
            return "vector", ()
        if kind is bool:
            return "flag", ()
        if kind is int:
            bounds = [getattr(x, side, None) for side in ("ge", "le") for x in info.metadata]
            return "whole", tuple(x for x in bounds if x is not None)
        if get_origin(kind) is Literal:
            return "choice", get_args(kind)
        table = isinstance(kind, type) and issubclass(kind, fields.Frozen)
        if table or (get_origin(kind) is tuple and get_origin(get_args(kind)[0]) is tuple):
            return "rows", ()
    return "number", ()


def optional(item: Any, field: str) -> bool:
    """Check whether a field may be left out."""
    info = type(item).model_fields.get(field)
    return info is not None and type(None) in set(_types(info.annotation))


def varies(item: Any, field: str) -> bool:
    """Check whether a field takes an expression in time and the motion in place of a number."""
    info = type(item).model_fields.get(field)
    return info is not None and {float, str} <= set(_types(info.annotation))


def _types(annotation: Any) -> Iterator[Any]:
    """Return the types allowed by an annotation."""
    if get_origin(annotation) in (Annotated, Union, UnionType):
        parts = get_args(annotation)
        for part in parts[:1] if get_origin(annotation) is Annotated else parts:
            yield from _types(part)
    else:
        yield annotation


def own_fields(item: Any) -> tuple[str, ...]:
    """Return the fields relevant to a part, in the order in which a user sets them."""
    names = [name for name in type(item).model_fields if name not in ("name", "active")]
    if isinstance(item, pg.Contact):
        rigid = item.law == "complementarity"
        first = ("law", "body", "other")
        left = [n for n in names if not (rigid and n in ("stiffness", "damping"))]
        return (*first, *(name for name in left if name not in first))
    if isinstance(item, pg.Cam):
        return tuple(n for n in names if n not in cams.unused(item))
    if isinstance(item, pg.Output):
        shown = [n for n in names if n != "imperfect"]
        return tuple(n for n in shown if n != "coordinate" or item.kind in OF_JOINT)
    if "through" in names:  # the first moving body follows from the stations
        return tuple(n for n in names if n != "body")
    if first := first_fields(item):
        names = [*first, *(name for name in names if name not in first)]
    sums = isinstance(item, (pg.Velocity, pg.Coupling, pg.Tendon))
    return tuple(n for n in names if n != "body" or not sums)


def of_path(item: Any) -> tuple[str, ...]:
    """Return the fields of the points of a path, in their order along it."""
    if "through" in type(item).model_fields:
        return ("through",)
    if not getattr(item, "PLACES", ()):
        return ()
    return "point", "shifts", *item.PLACES, "other_point", "other_shifts"


def first_fields(item: Any) -> tuple[str, ...]:
    """Return the fields that a form of a force shows first, or none if it shows all in order."""
    first = item.FIRST if isinstance(item, pg.Force) else ()
    fields = type(item).model_fields
    return tuple(n for n in ("kind", "body", "other", *first) if n in fields) if first else ()


SELDOM = {"windup", "tracking", "start", "sample"}  # fields of controllers


def rare(item: Any, name: str) -> bool:
    """Check whether a field is at its default and seldom needed, so that a form lists it last."""
    if first := first_fields(item):
        seldom = {*own_fields(item)} - {*first, *of_path(item)}
    else:
        seldom = SELDOM if isinstance(item, pg.Control) else set()
    return name in seldom and getattr(item, name) == type(item).model_fields[name].default


def takes_other(part: str, kind: str) -> bool:
    """Check whether a new part of that kind needs a second body."""
    kinds = {"constraints": pg.Constraint.KINDS, "forces": pg.Force.KINDS}.get(part)
    if kinds is None:
        return part in ("contacts", "loops")
    return "other" in kinds[kind].model_fields and kind != "skate"


@dataclass(frozen=True)
class Client(model.Client, pose.Client):
    picking: Picking | None = None
    opened: tuple[str, str] | None = None  # (part, name) of what the constraints tab shows whole
    listed: str | None = None  # body whose constraints alone are listed
    called: int = 0  # number of requests to show the constraints tab

    def afresh(self) -> Self:
        return replace(super().afresh(), picking=None, opened=None, listed=None)

    def followed(self, old: pg.Model, new: pg.Model, names: Names) -> Self:
        opened = self.opened and (self.opened[0], names.get(self.opened, self.opened[1]))
        listed = self.listed and names.get(("bodies", self.listed), self.listed)
        return replace(super().followed(old, new, names), opened=opened, listed=listed)

    def choosing(self, body: str | None, bodies: tuple[str, ...]) -> Self:
        return replace(super().choosing(body, bodies), opened=None)

    def escaped(self) -> Self | None:
        return super().escaped() if self.opened is None else replace(self, opened=None)

    def again(self, fresh: Any) -> Self:
        return replace(super().again(fresh), called=fresh.called)


@dataclass(frozen=True)
class State(model.State, pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    mobility: MobilityReport | None = None
    mobility_asked: pg.Model | None = None  # a large model, whose report takes long

    @property
    def freedom(self) -> str:
        """'1 DoF (3 in tree)' once the mobility is known, and '… DoF (3 in tree)' until then."""
        tree, report = self.derived.dof, MobilityReport.known(self)
        if not any(c.active for c in self.model.constraints):
            return super().freedom
        known = report.found if report else None
        if known and known.dof == tree:
            return super().freedom
        return f"{known.dof if known else '…'} DoF ({tree} in tree)"

"""The selected body's properties, as groups of fields of cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

import pgraph_core as pg

from ..client.bridge import Bridge
from ..state import State
from . import Payload, audience, css

XYZ = ("x", "y", "z")
WXYZ = ("w", *XYZ)
JOINTS = get_args(pg.Body.model_fields["joint"].annotation)
Q_NAMES = {"free": (*XYZ, *WXYZ), "spherical": WXYZ}
V_NAMES = {"free": ("ωx", "ωy", "ωz", *XYZ), "spherical": ("ωx", "ωy", "ωz")}


@dataclass(frozen=True)
class About:
    """What a person is told of a field."""

    label: str
    unit: str = ""
    help: str = ""


ABOUT = {
    "name": About("Name"),
    "joint": About("Joint", "", "how it moves on its parent"),
    "axes": About("Axis", "", "direction in the body's axes at q = 0; any length"),
    "link": About(
        "Link vector", "m", "from the parent's origin to this body's, parent axes, q = 0"
    ),
    "rotation": About(
        "Orientation", "", "unit quaternion: this body's axes in the parent's, q = 0"
    ),
    "mass": About("Mass", "kg", "at least 0"),
    "com": About("Centre of mass", "m", "in body axes"),
    "inertia": About("Inertia", "kg m²", "about the centre of mass, in body axes; symmetric"),
    "tip": About("Tip", "m", "point of interest, in body axes; empty: the centre of mass"),
    "q": About("q", "rad, m", "initial joint position"),
    "v": About("v", "rad/s, m/s", "initial joint velocity"),
    "stiffness": About("Stiffness", "N m/rad, N/m", "spring of each motion of the joint"),
    "rest": About("Rest position", "rad, m", "where the spring is relaxed"),
    "damping": About("Damping", "N m s/rad", "viscous damper of each motion of the joint"),
    "friction": About("Friction", "N m, N", "Coulomb's, of each rotation or translation"),
    "armature": About("Armature", "kg m²", "inertia of the drive, felt by the joint alone"),
}


class PropertiesView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("properties")

    def render(self, old: State, new: State) -> None:
        for client, now in new.clients.items():
            before = old.clients.get(client)
            same = before is not None and before.selection == now.selection
            if client in audience(old, new, new.derived is not old.derived or not same):
                self._bridge.send(client, "properties", properties(new, now.selection))


def properties(state: State, name: str | None) -> Payload:
    """What the panel shows of body `name`; a hint where none is selected."""
    if name is None or name not in state.derived.number:
        gravity = ", ".join(f"{x:g}" for x in state.model.gravity)
        return {"body": None, "hint": f"Gravity [{gravity}] m/s², {state.model.up} is up."}
    body, number = state.model.body(name), state.derived.number[name]
    return {
        "body": name,
        "number": number,
        "color": css(state.derived.colors[number - 1]),
        "subtitle": f"body {number}, {body.joint} joint to {body.parent}",
        "groups": groups(body),
    }


def groups(body: pg.Body) -> list[Payload]:
    """The fields in the order a person builds a body: the joint, the mass, the initial state."""
    joint = [
        {**_field("name", [_cell((), body.name)]), "numeric": False},
        {**_field("joint", [_cell((), body.joint)]), "numeric": False, "options": JOINTS},
        *_axes(body),
        _vector("link", body.link),
        _vector("rotation", body.rotation, WXYZ),
    ]
    inertia = [_cell((i, j), x) for i, row in enumerate(body.inertia) for j, x in enumerate(row)]
    mass = [
        _field("mass", [_cell((), body.mass)]),
        _vector("com", body.com),
        _field("inertia", inertia, columns=3),
        _tip(body),
    ]
    names = Q_NAMES.get(body.joint, ()), V_NAMES.get(body.joint, ())
    state = [_vector("q", body.q, names[0]), _vector("v", body.v, names[1])]
    spring = [
        _vector(name, getattr(body, name))
        for name in ("stiffness", "rest", "damping", "friction", "armature")
    ]
    found = [
        _group("", joint),
        _group("Mass", mass),
        _group("Initial state", state),
        _group("Spring, damper, drive", spring, is_open=any(body.stiffness + body.damping)),
    ]
    return [group for group in found if group["fields"]]


def _axes(body: pg.Body) -> list[Payload]:
    several = len(body.axes) > 1
    return [
        {
            **_field("axes", [_cell((i, j), x) for j, x in enumerate(axis)], columns=3),
            "label": f"Axis {i + 1}" if several else "Axis",
        }
        for i, axis in enumerate(body.axes)
    ]


def _tip(body: pg.Body) -> Payload:
    cells = [{**_cell((i,), x), "implied": body.tip is None} for i, x in enumerate(body.tip_point)]
    return _field("tip", cells, columns=3)


def _group(title: str, fields: list[Payload], is_open: bool = True) -> Payload:
    return {"title": title, "open": is_open, "fields": [f for f in fields if f["cells"]]}


def _vector(field: str, values: tuple[float, ...], names: tuple[str, ...] = ()) -> Payload:
    """A cell a number; x, y, z go without saying, other components are named."""
    names = names or ("",) * len(values)
    cells = [_cell((i,), x, names[i]) for i, x in enumerate(values)]
    return _field(field, cells, columns=4 if len(values) == 4 else min(len(values), 3))


def _field(field: str, cells: list[Payload], columns: int = 1) -> Payload:
    about = ABOUT[field]
    return {
        "field": field,
        "label": about.label,
        "unit": about.unit,
        "help": about.help,
        "cells": cells,
        "columns": columns,
        "numeric": True,
        "options": None,
    }


def _cell(index: tuple[int, ...], value: Any, name: str = "") -> Payload:
    return {"index": index, "value": value, "name": name}

"""The selected body's properties, as groups of fields of cells."""

from __future__ import annotations

from typing import Any, get_args

import pgraph_core as pg

from ..client.bridge import Bridge
from ..state import State
from . import Payload, audience, css

XYZ = ("x", "y", "z")
WXYZ = ("w", *XYZ)
JOINTS = get_args(pg.Body.model_fields["joint"].annotation)
Q_LABELS = {"free": (*XYZ, *WXYZ), "spherical": WXYZ}
V_LABELS = {"free": ("ωx", "ωy", "ωz", *XYZ), "spherical": ("ωx", "ωy", "ωz")}


class PropertiesView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        bridge.host("properties")

    def render(self, old: State, new: State) -> None:
        for client in new.clients:
            before = old.clients.get(client)
            same = before is not None and before.selection == new.clients[client].selection
            if client in audience(old, new, new.derived is not old.derived or not same):
                payload = properties(new, new.clients[client].selection)
                self._bridge.send(client, "properties", payload)


def properties(state: State, name: str | None) -> Payload:
    """What the panel shows of body `name`; a hint where none is selected."""
    if name is None or name not in state.derived.number:
        hint = f"Gravity {_shown(state.model.gravity)} m/s², {state.model.up} is up."
        return {"body": None, "hint": hint}
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
    q, v = Q_LABELS.get(body.joint, ()), V_LABELS.get(body.joint, ())
    joint = [
        _text("name", "Name", body.name),
        _choice("joint", "Joint", body.joint, JOINTS),
        *_axes(body),
        _vector("link", "Link vector", "m", body.link, XYZ, "from the parent's origin to this body's, in the parent's axes at q = 0"),
        _vector("rotation", "Orientation", "", body.rotation, WXYZ, "unit quaternion w x y z: this body's axes in the parent's at q = 0"),
    ]  # fmt: skip
    mass = [
        _field("mass", "Mass", "kg", [_cell((), body.mass)]),
        _vector("com", "Centre of mass", "m", body.com, XYZ, "in body axes"),
        _field("inertia", "Inertia", "kg m²", [_cell((i, j), body.inertia[i][j]) for i in range(3) for j in range(3)], 3, "about the centre of mass, in body axes; symmetric"),
        _tip(body),
    ]  # fmt: skip
    state = [
        _vector("q", "q", "rad, m", body.q, q, "initial joint position"),
        _vector("v", "v", "rad/s, m/s", body.v, v, "initial joint velocity"),
    ]
    spring = [
        _vector("stiffness", "Stiffness", "N m/rad, N/m", body.stiffness, (), "spring of each motion of the joint"),
        _vector("rest", "Rest position", "rad, m", body.rest, (), "where the spring is relaxed"),
        _vector("damping", "Damping", "N m s/rad", body.damping, (), "viscous damper of each motion"),
        _vector("armature", "Armature", "kg m²", body.armature, (), "inertia of the drive, felt by the joint alone"),
    ]  # fmt: skip
    found = [
        _group("", joint), _group("Mass", mass), _group("Initial state", state),
        _group("Spring, damper, drive", spring, is_open=any(body.stiffness + body.damping)),
    ]  # fmt: skip
    return [group for group in found if group["fields"]]


def _axes(body: pg.Body) -> list[Payload]:
    label = ("Axis",) if len(body.axes) == 1 else tuple(f"Axis {i + 1}" for i in range(6))
    return [
        _field("axes", label[i], "", [_cell((i, j), x, XYZ[j]) for j, x in enumerate(axis)], 3,
               "direction in the body's axes at q = 0; any length")
        for i, axis in enumerate(body.axes)
    ]  # fmt: skip


def _tip(body: pg.Body) -> Payload:
    help = "the point of interest, in body axes; empty: the centre of mass"
    cells = [
        {**_cell((i,), x, XYZ[i]), "implied": body.tip is None}
        for i, x in enumerate(body.tip_point)
    ]
    return _field("tip", "Tip", "m", cells, 3, help)


def _group(title: str, fields: list[Payload], is_open: bool = True) -> Payload:
    return {"title": title, "open": is_open, "fields": [f for f in fields if f["cells"]]}


def _field(
    field: str, label: str, unit: str, cells: list[Payload], columns: int = 1, help: str = ""
) -> Payload:
    return {"field": field, "label": label, "unit": unit, "cells": cells, "columns": columns,
            "help": help, "numeric": True, "options": None, "named": False}  # fmt: skip


def _cell(index: tuple[int, ...], value: Any, label: str = "") -> Payload:
    return {"index": index, "value": value, "label": label}


def _vector(
    field: str, label: str, unit: str, values: tuple[float, ...], names: tuple[str, ...], help: str
) -> Payload:
    names = names or ("",) * len(values)
    cells = [_cell((i,), x, names[i]) for i, x in enumerate(values)]
    columns = 4 if len(values) == 4 else min(max(len(values), 1), 3)
    named = len(values) > 3 and any(names)  # x, y, z go without saying
    return {**_field(field, label, unit, cells, columns, help), "named": named}


def _text(field: str, label: str, value: str) -> Payload:
    return {**_field(field, label, "", [_cell((), value)]), "numeric": False}


def _choice(field: str, label: str, value: str, options: tuple[str, ...]) -> Payload:
    return {**_text(field, label, value), "options": options}


def _shown(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{x:g}" for x in values) + "]"

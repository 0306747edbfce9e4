"""Properties of one or several bodies, and mass computed from shapes (pure)."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

import pgraph_core as pg
from pgraph_core.mesh_files import FORMATS, load_mesh
from pgraph_core.model.shape import mass_properties, mass_properties_of

from ..core import cells
from ..core.cells import Display, Refusal
from ..core.edit import edited
from ..core.events import Chosen, Entries, ModelEdit, OfBodies, Text
from ..core.state import Notice, display_of, replied, told
from ..model import Found, sent, sent_file
from ..model.archive import mesh_folder
from . import State, beam_cells
from . import world as world  # its events
from .body_cells import edit_of, mended, rod_of
from .length import stretched

LENGTH = "body_length"
LABELS = {
    "body_length": "length",
    "rotation": "orientation", "rotation_euler": "orientation", "rotation_axis": "orientation",
    "com": "centre of mass", "link": "link vector", "motions": "motions",
}  # fmt: skip
BodyField = Literal[
    "name", "parent", "joint", "dof",
    "motions", "axes", "link", "rotation", "rotation_euler", "rotation_axis",
    "mass", "com", "inertia", "tip", "q", "v", "stiffness", "damping", "rest", "friction",
    "armature", "limits", "limit_restitution", "speed_limit", "pitch",
    "track_points", "track_up", "track_x", "track_y", "track_z", "track_angles",
    "shape_kind", "shape_size", "shape_radius",
    "shape_radii", "shape_length", "shape_end_radius", "shape_scale", "shape_position",
    "shape_rotation",
    "shape_rotation_euler", "shape_rotation_axis", "shape_role", "shape_colour", "shape_opacity",
    "shape_surface_velocity", "shape_surface_spin",
    "derived",
    "body_length",
]  # fmt: skip
FurtherShape = Annotated[str, Field(pattern=r"^shape_\d{1,9}_[a-z_]{4,20}$")]


class Typed(OfBodies):
    """Text typed into the cells of one field, for one or several bodies."""

    serial: int
    bodies: Chosen
    field: BodyField | beam_cells.BeamField | FurtherShape
    entries: Entries


class EditBodies(Typed, ModelEdit):
    """An edit of cells, committed by leaving them or by pressing Enter."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        return _edited(state, self), _label(self)

    def then(self, before: State, after: State) -> State:
        """Tell that a typed mass leaves an inertia that was given, not derived."""
        if self.field != "mass":
            return after
        kept = [
            body.name
            for body in (after.model.body(x) for x in self.bodies if x in after.model.row)
            if "inertia" not in body.derived
            and np.any(body.inertia)
            and body.mass != before.model.body(body.name).mass
        ]
        if not kept:
            return after
        one = f"'{kept[0]}'" if len(kept) == 1 else f"{len(kept)} bodies"
        text = (
            f"The inertia of {one} stays as it was given: type it, or let it follow from the mass "
            "and the shape by From shape."
        )
        return told(after, self.client, Notice("Inertia not changed", text))

    def offer(self, state: State) -> str:
        return _offer(state, self)


class Check(Typed):
    """A check of text while it is being typed, which changes nothing. Unfinished numbers pass."""

    def applied(self, state: State) -> State:
        problem = offer = ""
        try:
            _edited(state, self)
        except pg.PgraphError as error:
            problem, offer = str(error), _offer(state, self)
        except Refusal:
            pass
        return replied(state, self.client, self.serial, problem, offer)


class Mend(Typed, ModelEdit):
    """Replace refused entries by the nearest values that the bodies accept."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        new = {}
        for name, change in _changes(state, self).items():
            mending = mended(state.model.body(name), *_one(self, change))
            if mending is None:
                raise Refusal("the inertia is valid")
            new[name] = mending
        return state.model.edit_all(new), f"repair {_label(self)}"


def _label(event: Typed) -> str:
    field = event.field.removeprefix("shape_") if event.field != "shape_kind" else "shape"
    field = {"derived": "fields derived from the shapes"}.get(field, field)
    several = f"{len(event.bodies)} bodies"
    of = event.bodies[0] if len(event.bodies) == 1 else several
    return f"{LABELS.get(event.field, field)} of {of}"


def _changes(state: State, event: Typed) -> dict[str, dict[str, Any]]:
    display, changes = display_of(state, event.client), {}
    for name in event.bodies:
        row = row_named(state.model, name)
        try:
            changes[name] = row_edit(state.model, row, event.field, event.entries, display)
        except Refusal as refusal:
            field = LABELS.get(event.field, event.field.replace("_", " "))
            raise Refusal(f"{row.word()} '{name}', {field}: {refusal}") from None
    return changes


def row_named(model: pg.Model, name: str) -> pg.Body | pg.Beam:
    """Return the body or beam of a row of the table. Raises ModelError."""
    return next((beam for beam in model.beams if beam.name == name), None) or model.body(name)


def row_edit(
    model: pg.Model, row: pg.Body | pg.Beam, field: str, entries: Entries, display: Display
) -> dict[str, Any]:
    """Return the arguments of `model.edit` that store text typed for a row. Raises Refusal."""
    if field == "place":
        return {"parent": beam_cells.placed(model, row.parent, entries[0][1])}
    of = beam_cells.edit_of if isinstance(row, pg.Beam) else edit_of
    return of(model, row, field, entries, display)  # type: ignore[arg-type]


def _edited(state: State, event: Typed) -> pg.Model:
    if event.field == "name" and len(event.bodies) > 1:
        raise Refusal("several bodies cannot have one name; select one")
    if event.field == LENGTH:
        return _stretched(state, event)
    changes = _changes(state, event)
    return rows_edited(state.model, changes)


def rows_edited(model: pg.Model, changes: Mapping[str, Mapping[str, Any]]) -> pg.Model:
    """Return the model with changed fields of bodies and beams. Raises PgraphError."""
    bodies = {name: change for name, change in changes.items() if name in model.row}
    for name in changes.keys() - bodies.keys():
        model = model.edit(name, kind="beam", **changes[name])
    if len(bodies) == 1:
        ((name, change),) = bodies.items()
        return model.edit(name, **change)
    return model.edit_all(bodies) if bodies else model


def _stretched(state: State, event: Typed) -> pg.Model:
    try:
        text, display = event.entries[0][1], display_of(state, event.client)
        length = cells.quantity(text, "length", display)
        return stretched(state.model, event.bodies, length)
    except Refusal as refusal:
        raise Refusal(f"body '{event.bodies[0]}', length: {refusal}") from None


def _offer(state: State, event: Typed) -> str:
    """Return the label of the repair for refused entries, or "" if there is none."""
    if event.field == LENGTH:
        return ""
    try:
        changes = _changes(state, event)
        bodies = [mended(state.model.body(n), *_one(event, c)) for n, c in changes.items()]
        if None in bodies:
            return ""
        state.model.edit_all({n: b for n, b in zip(changes, bodies) if b is not None})
    except (Refusal, pg.PgraphError, ValueError, OverflowError):
        return ""
    return {"inertia": "Use the nearest possible inertia"}.get(event.field, "Make it a unit one")


def _one(event: Typed, change: dict[str, Any]) -> tuple[str, Any]:
    field = "rotation" if event.field.startswith("rotation") else event.field
    return field, change


# -- mass from shape, meshes -------------------------------------------------------------------


class FillFromShape(OfBodies):
    """Derive mass, centre of mass and inertia from the shapes and a typed density.

    Meshes are read in a background job.
    """

    serial: int
    bodies: Chosen
    density: Text

    def applied(self, state: State) -> State:
        try:
            density = cells.number(self.density)
            if density <= 0:
                raise Refusal(f"must be > 0 [kg/m³], got {density:g}")
            bodies = [state.model.body(name) for name in self.bodies]
        except (Refusal, pg.PgraphError) as problem:
            sentence = f"The density {problem}" if isinstance(problem, Refusal) else str(problem)
            return replied(state, self.client, self.serial, sentence)
        if any(shape.file for b in bodies for shape in b.shapes):
            state = replied(state, self.client, self.serial)
            work = partial(_filled, bodies=self.bodies, density=density)
            return sent(state, self.client, "mass from shape", work)
        of = self.bodies[0] if len(bodies) == 1 else f"{len(bodies)} bodies"
        make = lambda: (state.model.edit_all(mass_of(bodies, density)), f"mass of {of} from shape")  # noqa: E731
        return edited(state, self.client, make, self.serial)


def _filled(model: pg.Model, bodies: tuple[str, ...], density: float) -> Found:
    text = "Mass, centre of mass and inertia follow from the shape."
    return Found(text, mass_of([model.body(name) for name in bodies], density))


class UploadMesh(OfBodies):
    """Use a mesh file that the page has read as the shape of these bodies, in an errand."""

    bodies: Chosen
    name: Text
    content: Annotated[str, Field(max_length=15_000_000)]  # base64

    def applied(self, state: State) -> State:
        work = partial(shaped, self.bodies, self.name)
        leaves = partial(_place_of, self.name)
        return sent_file(state, self.client, self.content, "mesh file", work, leaves)


# -- meshes ----------------------------------------------------------------------------------------


LARGEST_MESH = 10_000_000  # [bytes]
LARGE = 5.0  # [m] a mesh beyond this is likely not in metres


def _place_of(file: str, content: bytes) -> Path:
    """Return the path of an uploaded mesh file."""
    stem = re.sub(r"[^\w-]+", "_", Path(file).stem)[:60] or "mesh"
    suffix = Path(file).suffix.lower()
    return mesh_folder() / f"{stem}-{hashlib.sha256(content).hexdigest()[:8]}{suffix}"


def shaped(bodies: tuple[str, ...], file: str, content: bytes, _: Any = None) -> Found:
    """Store the uploaded file and use it as the shape of these bodies.

    Raises PgraphError, Refusal, OSError.
    """
    suffix = Path(file).suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise Refusal(f"meshes are not read from .{suffix} files; give one of {', '.join(FORMATS)}")
    if len(content) > LARGEST_MESH:
        size = len(content) / 1e6
        raise Refusal(f"{file} has {size:.1f} MB; a mesh file has at most 10 MB")
    path = _place_of(file, content)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    try:
        mesh = load_mesh(path)
    except pg.PgraphError as error:
        path.unlink(missing_ok=True)
        raise Refusal(str(error).replace(str(path), file)) from None
    shape = pg.Shape(kind="mesh", file=str(path))
    x, y, z = (float(e) for e in mesh.extents)
    text = f"{file}: {len(mesh.faces)} faces, {x:.3g} × {y:.3g} × {z:.3g} m."
    if max(mesh.extents) > LARGE:
        text += " If its numbers are millimetres, set the scale to 0.001."
    try:
        mass_properties(shape, 1.0)
    except pg.PgraphError as error:
        why = str(error).split(": ", 1)[-1]
        text += f" It is drawn and touches, but has no volume: {why}."
    return Found(text, {name: {"shape": shape} for name in bodies})


def mass_of(bodies: list[pg.Body], density: float) -> dict[str, dict[str, Any]]:
    """Return the fields that derive mass, centre of mass and inertia of bodies from their shapes.

    A body without a shape gets the rod as which it is drawn.
    Raises PgraphError, Refusal.
    """
    found = {}
    for body in bodies:
        rod = {} if body.shapes else {"shape": rod_of(body)}
        mass = mass_properties_of(body.shapes or tuple(rod.values()), density).mass
        if not (math.isfinite(mass) and mass >= 0):
            raise Refusal(f"gives '{body.name}' a mass of {mass}")
        derived = tuple(dict.fromkeys((*body.derived, "mass", "com", "inertia")))
        found[body.name] = {**rod, "density": density, "derived": derived}
    return found

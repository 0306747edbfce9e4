"""Every field of every kind says what it is: dimension, role and schema version."""

import inspect
from pathlib import Path

import pytest

import pgraph_core as pg
from pgraph_core import forces
from pgraph_core.fields import Frozen, facts
from pgraph_core.model.files import SCHEMA_VERSION
from pgraph_core.units import UNITS, Dim

KINDS = [
    pg.Body, pg.Shape, pg.Beam, pg.Contact, pg.Ground, pg.Step, pg.Site, pg.Output,
    *pg.Force.KINDS.values(), *pg.Constraint.KINDS.values(),
]  # fmt: skip
FIELDS = [(kind, name) for kind in KINDS for name in kind.model_fields]
VECTORS = ("point", "direction", "vector", "axial", "frame", "tensor", "screw", "joint", "track")


def where(kind):
    return Path(inspect.getsourcefile(kind)).name


@pytest.mark.parametrize(("kind", "name"), FIELDS, ids=lambda x: getattr(x, "__name__", x))
def test_a_field_with_numbers_has_a_dimension_and_one_with_directions_a_role(kind, name):
    info = kind.model_fields[name]
    own, holds = facts(info), str(info.annotation)
    place = f"{where(kind)}: {kind.__name__}.{name}"
    if own.role == "parts":
        return
    assert own.role in ("", *VECTORS), place
    if "float" in holds or "Table" in holds or "Lines" in holds:
        assert own.dim is not None or own.role in VECTORS, f"{place} has no dim"
    if holds.count("float") in (3, 4) and "..." not in holds and own.dim != Dim():
        lengths = name in ("size", "radii")  # of a solid along its own axes
        assert own.role in VECTORS or lengths, f"{place} has no role"
    assert 1 <= own.since <= SCHEMA_VERSION, place


@pytest.mark.parametrize("kind", [k for k in KINDS if issubclass(k, Frozen)])
def test_forms_know_the_unit_of_every_dimension(kind):
    for name, info in kind.model_fields.items():
        assert (facts(info).dim or Dim()) in UNITS, f"{where(kind)}: {kind.__name__}.{name}"


def test_two_kinds_have_no_name_in_common_and_every_file_one_of_its_own():
    kinds = [one.kind for one in forces.LOADS]
    assert len(set(kinds)) == len(kinds)
    for one in forces.LOADS:
        for part in one.parts:
            assert where(part) == f"{part.own_kind()}.py"
            assert pg.Force.KINDS[part.own_kind()] is part
            assert part.ABOUT, where(part)
            assert part.SCALES, where(part)
    on_bodies = {c for c in pg.Force.KINDS.values() if issubclass(c, forces.OnBody)}
    assert on_bodies == {part for one in forces.LOADS for part in one.parts}


TEXTS = [
    (kind, name)
    for kind, name in FIELDS
    if "str" in (holds := str(kind.model_fields[name].annotation)) and "Literal" not in holds
    if not (name == "body" and "through" in kind.model_fields)  # it follows from the stations
]


@pytest.mark.parametrize(("kind", "name"), TEXTS, ids=lambda x: getattr(x, "__name__", x))
def test_a_text_that_no_file_can_hold_is_refused(kind, name):
    """Names of files that are not UTF-8 and escapes in JSON have lone surrogates."""
    with pytest.raises(pg.ModelError) as refused:
        kind(**{name: "caf\udce9"})
    problems = [p.text for p in refused.value.problems if p.field.split("[")[0] == name]
    assert problems, refused.value
    assert "UTF-8" in problems[0] or "udce9" in problems[0]

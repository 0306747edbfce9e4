"""docs/description.md against the schema: every field, every kind, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import pgraph_core as pg
from tests.worlds import NEEDS

pytestmark = pytest.mark.quick

TEXT = (Path(__file__).parent.parent / "docs" / "description.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", TEXT, flags=re.M | re.S))
PARTS = (
    *(pg.Model, pg.Ground, pg.Step, pg.Body, pg.Shape, pg.Constraint, pg.Contact, pg.Force),
    *(pg.Table, pg.Scenario, pg.Switch, pg.Gait, pg.Footfall, pg.Gains, pg.Site, pg.Output),
)


def tables(name):
    """The first columns of a section's tables, as the names in them."""
    found = []
    for block in re.split(r"\n\n", SECTIONS[name]):
        if block.lstrip().startswith("|"):
            rows = block.strip().splitlines()[2:]
            found.append([n for row in rows for n in re.findall(r"`(\w+)`", row.split("|")[1])])
    return found


def fields(part):
    """The fields of a part, of all its kinds."""
    return part.fields_of_kinds() if hasattr(part, "KINDS") else part.model_fields


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.__name__)
def test_every_field_is_described_once(part):
    assert sorted(tables(part.__name__)[0]) == sorted(fields(part))


def test_every_kind_is_described_once_with_its_class():
    for part in (pg.Constraint, pg.Force):
        kinds = tables(part.__name__)[1]
        assert kinds == [x for kind, each in part.KINDS.items() for x in (kind, each.__name__)]


def test_the_number_of_rows_of_each_kind_is_that_of_its_blocks():
    kinds = SECTIONS["Constraint"].split("| kind | rows")[1]
    rows = dict(re.findall(r"^\| `(\w+)` `\w+` \| (\d) \|", kinds, flags=re.M))
    assert set(rows) == set(pg.Constraint.KINDS)
    for kind, count in rows.items():
        c = pg.Constraint(name="c", kind=kind, body="2", **NEEDS.get(kind, {}))
        mech = pg.Mechanism(pg.Model.serial(2).replace(constraints=(c,)))
        assert mech.packed.blocks.blocks_i[:, 3].sum() == int(count), kind

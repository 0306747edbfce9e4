"""A page shows the segments of beams, and tells that it does."""

import pytest

import pgraph_core as pg

from .store import ME, after, begun, do, notice

pytestmark = pytest.mark.quick
ROD = pg.Beam(name="rod", length=1.0, EI=1.0, rho_a=1.0, nodes=4)
BEAMED = pg.Model(beams=[ROD], bodies=[pg.Body(name="load", parent="rod", joint="weld")])
SEGMENTS = ["load", *(f"rod[{k}]" for k in range(5)), "rod"]


def test_a_page_begins_with_the_segments_of_beams():
    assert [body.name for body in begun(BEAMED).model.bodies] == SEGMENTS


def test_a_file_with_beams_is_opened_as_segments_with_a_notice():
    state = after(begun(pg.Model.serial(1)), do.OpenText(ME, "m.json", BEAMED.to_json()))
    assert [body.name for body in state.model.bodies] == SEGMENTS
    assert "beam 'rod' became its 4 segments" in notice(state)
    assert "another name" in notice(state)

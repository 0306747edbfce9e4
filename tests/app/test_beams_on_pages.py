"""Beams on a page: a row of the table each, with a form, drawn as segments that bend."""

import json

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints.view import constraints
from pgraph_app.core.events import from_page
from pgraph_app.digraph.view import digraph
from pgraph_app.plots import SCENE, Signal, curves
from pgraph_app.plots.ready import ready
from pgraph_app.pose import poses
from pgraph_app.properties.view import properties
from pgraph_app.scene import marks
from pgraph_app.table.view import table

from .store import ME, after, begun, do, notice, ran, reply

pytestmark = pytest.mark.quick
ROD = pg.Beam(name="rod", length=1.0, section=("circle", 0.01), material="steel", nodes=4)
LOAD = pg.Body(name="load", parent="rod", joint="weld", mass=1.0)
BEAMED = pg.Model(beams=[ROD], bodies=[LOAD])
SEGMENTS = tuple(f"rod[{k}]" for k in range(5))


def edit(state, field, *entries, name="rod"):
    """Return the state after text was typed into cells of a field, each (index, text).

    The event comes as from a page, which checks the names of fields.
    """
    sent = {"serial": 1, "bodies": [name], "field": field, "entries": entries}
    return after(state, from_page(ME, json.dumps({"event": "EditBodies", **sent})))


def typed(state, field, text, *index):
    return edit(state, field, (index, text))


def beam(state):
    return state.model.beams[0]


def form(state, name="rod"):
    found = properties(state, (name,))
    return {row["field"]: row for group in found["groups"] for row in group["fields"]}


def test_a_page_keeps_a_beam_as_one_row_of_table_and_graph_and_draws_its_segments():
    state = begun(BEAMED)
    assert state.model is BEAMED
    rows = {row["name"]: row for row in table(state)["rows"]}
    assert list(rows) == ["load", "rod"]
    assert rows["rod"]["joint"] == "beam"
    assert rows["rod"]["dof"] == 12
    assert rows["load"]["parent"] == "rod"
    drawn = digraph(state)
    assert sorted(drawn["names"]) == ["load", "rod"]
    assert sum(drawn["dof"]) == 12
    assert drawn["masses"][drawn["names"].index("rod")] == pytest.approx(7850 * np.pi * 1e-4)
    assert set(SEGMENTS) < set(state.derived.names)
    assert len(marks.looks(state)) == len(poses(state)[0]) == len(state.derived.names)


def test_a_click_on_a_segment_selects_the_beam_and_fills_all_of_it():
    state = begun(BEAMED)
    state = after(state, do.Select(ME, state.row_of("rod[2]")))
    assert state.clients[ME].selected == ("rod",)
    assert state.drawn_as(("rod", "load")) == (*SEGMENTS, "load")


def test_a_beam_is_added_renamed_copied_mirrored_and_deleted_and_each_is_one_undo_step():
    state = after(begun(pg.Model.serial(1)), do.AddBeam(ME, "1"))
    assert (beam(state).parent, beam(state).name) == ("1", "beam")
    assert beam(state).link == state.model.body("1").tip_point
    assert beam(state).damping_ratio > 0  # or its run may take minutes
    assert state.clients[ME].selected == ("beam",)
    state = typed(state, "name", "rod")
    state = edit(state, "name", ((), "rod"), name="beam")
    assert beam(state).name == "rod"
    assert state.clients[ME].selected == ("rod",)
    two = after(state, do.Duplicate(ME, ("rod",), True))
    assert [b.name for b in two.model.beams] == ["rod", "rod_2"]
    assert two.clients[ME].selected == ("rod_2",)
    two = after(state, do.MirrorBranch(ME, "rod", "x", ("rod",)))
    assert len(two.model.beams) == 2
    gone = after(two, do.DeleteBodies(ME, ("rod",), "attach"))
    assert len(gone.model.beams) == 1
    assert gone.clients[ME].selected != ("rod",)
    assert after(gone, do.Undo(ME)).model is two.model


def test_every_field_of_a_beam_has_a_cell_that_takes_its_own_text_again():
    """Only what a cell stands for is typed otherwise: section, name and strains."""
    for given in (ROD, pg.Beam(name="rod", points=[[1, 0, 0], [1, 1, 0]], EI=(1.0, 2.0),
                               GJ=0.5, rho_a=1.0, rho_j=0.1)):  # fmt: skip
        state = begun(pg.Model(beams=[given]))
        rows = form(state)
        cells = {"section_kind", "sizes", "deforms", "end"}
        others = pg.Beam.model_fields.keys() - {"parent", "section", "strains"}
        assert others <= rows.keys()
        assert rows.keys() - cells <= others
        for name, row in rows.items():
            entries = [(tuple(c["index"]), str(c["value"])) for c in row["cells"]]
            if name == "end" or (name == "points" and not given.points):
                continue
            if name == "length" and given.points:
                continue
            again = edit(state, name, *entries)
            assert reply(again) == "", name
            assert beam(again).stiff == given.stiff
            assert beam(again).extent == given.extent, name


@pytest.mark.parametrize(
    ("field", "text", "index", "told"),
    [
        ("length", "-1", (), "rod"),
        ("nodes", "many", (), "500"),
        ("nodes", "501", (), "500"),
        ("sizes", "0", (0,), "rod"),
        ("material", "cheese", (), "steel"),
        ("EI", "", (), "rod"),
        ("deforms", "flies", (), "bend_y"),
        ("parent", "rod", (), "rod"),
    ],
)
def test_what_a_beam_refuses_is_said_beside_its_cell(field, text, index, told):
    bare = pg.Beam(name="rod", length=1.0, EI=1.0, rho_a=1.0)
    state = begun(pg.Model(beams=[bare if field == "EI" else ROD]))
    state = typed(state, field, text, *index)
    assert told in reply(state)
    assert state.clients[ME].reply.failed is False


def test_the_section_of_a_beam_changes_its_kind_and_may_become_numbers():
    state = begun(BEAMED)
    tube = typed(state, "section_kind", "tube")
    assert beam(tube).section == ("tube", 0.01, 0.008)
    flat = edit(typed(state, "section_kind", "rectangle"), "sizes", ((0,), "0.05"), ((1,), "0.002"))
    assert beam(flat).section == ("rectangle", 0.05, 0.002)
    bare = typed(state, "section_kind", "none")
    assert beam(bare).section is None
    assert beam(bare).stiff.EI == ROD.stiff.EI
    assert beam(bare).stiff.rho_a == ROD.stiff.rho_a
    assert beam(typed(bare, "section_kind", "circle")).section is not None


def test_the_end_of_a_beam_turns_it_and_sets_its_length():
    for end in ((0.0, 0.0, 2.0), (-1.0, 0.0, 0.0), (0.3, -0.4, 0.0)):
        state = edit(begun(BEAMED), "end", *(((k,), str(x)) for k, x in enumerate(end)))
        assert [c["value"] for c in form(state)["end"]["cells"]] == pytest.approx(end)
        assert beam(state).extent == pytest.approx(np.linalg.norm(end))


def test_a_run_bends_what_is_drawn_and_its_moments_and_error_are_plots():
    result = pg.simulate(pg.Mechanism(BEAMED), t_end=0.05, rtol=1e-6)
    state = ran(begun(BEAMED), result)
    assert state.run is not None
    state = after(state, do.Scrub(ME, 0.05))
    now, _ = poses(state)
    home = state.derived.positions
    k = state.derived.number["rod"] - 1
    assert now[k, 2] < home[k, 2] - 1e-4
    charts = {one.label: one.signals for one in ready(result, ())}["Beams"]
    assert charts == [Signal("moment", "rod"), Signal("space_error", SCENE)]
    root = curves(result, charts[0])
    assert len(root) == 3
    assert max(abs(y) for y in root[1].y) > 1.0
    assert notice(state) == ""


def test_a_run_with_auto_draws_the_segments_that_it_used():
    model = BEAMED.edit("rod", nodes="auto", tolerance=1e-2)
    result = pg.simulate(pg.Mechanism(model), t_end=0.02, rtol=1e-6)
    state = ran(begun(model), result)
    assert len(state.derived.names) == len(result.mechanism.names)
    assert len(marks.looks(state)) == len(poses(state)[0])


def test_bodies_and_parts_hang_on_places_along_a_beam():
    state = edit(begun(BEAMED), "place", ((), "0.5"), name="load")
    assert state.model.body("load").parent == "rod@0.5"
    rows = {row["name"]: row for row in table(state)["rows"]}
    assert rows.keys() == {"load", "rod"}
    assert rows["load"]["parent"] == "rod"
    assert form(state, "load")["place"]["cells"][0]["value"] == 0.5
    assert "from 0" in reply(edit(state, "place", ((), "1.5"), name="load"))
    assert "place" not in form(begun(pg.Model.serial(1)), "1")
    state = after(begun(BEAMED), do.AddPart(ME, "constraints", "point", "rod"))
    state = after(state, do.PickName(ME, "ground"))
    kind = {"part": "constraints", "name": "point"}
    cell = {"serial": 1, "field": "body_on_beam", "entries": (((), "0.25"),)}
    state = after(state, do.EditPart(ME, **kind, **cell))
    assert state.model.constraints[0].body == "rod@0.25"
    assert table(state)["rows"][1]["constraints"] == ("point",)
    shown = constraints(state, state.clients[ME])["lists"][0]["items"][0]
    assert shown["bodies"] == ["rod"]
    assert "body_on_beam" in {row["field"] for group in shown["form"] for row in group["fields"]}


@pytest.mark.parametrize("kind", ["point", "weld", "line", "distance", "curve_point"])
def test_a_constraint_of_the_tip_of_a_beam_begins_where_it_is(kind):
    """The tip is a body without mass of its own: constraints asked for a row of the table."""
    state = after(begun(BEAMED), do.AddPart(ME, "constraints", kind, "rod"))
    state = after(state, do.PickName(ME, "ground"))
    assert [c.kind for c in state.model.constraints] == [kind]
    assert not pg.Mechanism(state.model).assemble()[2].notable
    assert constraints(state, state.clients[ME])["lists"][0]["items"][0]["form"]


def test_a_loop_is_closed_at_the_tip_of_a_beam():
    model = BEAMED.add(pg.Body(name="arm", joint="revolute", link=(1.0, 0.0, 0.0), mass=1.0))
    closed = model.close_loop("rod", "arm", joint="spherical")
    assert closed.constraints[0].pair == ("rod", "arm")
    assert closed.point_of(closed.constraints[0]) == (0.0, 0.0, 0.0)
    assert model.body("rod@0.25").link == pytest.approx((0.25, 0.0, 0.0))
    at, turned = pg.home_poses(model)
    assert at[pg.Topology.of(model).number("rod") - 1] == pytest.approx((1.0, 0.0, 0.0))
    with pytest.raises(pg.PgraphError, match="expanded"):
        pg.frame_update_trace(model, np.zeros(1), np.zeros(1))

"""A STEP file on the page: its parts, the proposed joints, and the model with those accepted."""

import json
from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.server import Server

from .conftest import opened
from .on_page import drop
from .store import ME, after, answered, begun, do, notice

pytest.importorskip("OCP")
from .. import step_files as made


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return made.write(tmp_path / "bars.step", made.four_bar()[0])


def test_joints_are_accepted_in_one_edit_that_can_be_undone(file):
    state = answered(begun(pg.Model.serial(1)), do.OpenAssembly(ME, file.name, file.read_text()))
    found = state.clients[ME].assembly
    assert [body.joint for body in state.model.bodies] == ["free"] * 4
    assert [joint.kind for joint in found.joints] == ["revolute"] * 4
    free, kinds = state.model, ["revolute"] * 3 + ["cylindrical"]
    accept = do.AcceptJoints(
        ME, tuple(enumerate(kinds)), densities=(("crank", "7850"),), fixed=("base",)
    )
    state = answered(state, accept)
    assert [body.joint for body in state.model.bodies] == ["weld", *["revolute"] * 3]
    assert [c.kind for c in state.model.constraints] == ["cylindrical"]
    assert state.model.body("crank").mass == pytest.approx(7.85 * free.body("crank").mass)
    report = state.clients[ME].conversion
    assert any("1 degree of freedom" in entry.text for entry in report.of("read"))
    undone = after(state, do.Undo(ME))
    assert undone.model is free
    assert undone.clients[ME].assembly is found


@pytest.mark.parametrize(
    ("given", "fact"),
    [
        ({"densities": (("crank", "steel"),)}, "number"),
        ({"densities": (("crank", "-1"),)}, "> 0"),
        ({"fixed": ("nothing",)}, "nothing"),
    ],
)
def test_what_cannot_be_accepted_is_told(given, fact, file):
    state = answered(begun(pg.Model.serial(1)), do.OpenAssembly(ME, file.name, file.read_text()))
    again = answered(state, do.AcceptJoints(ME, ((0, "revolute"),), **given))
    assert again.model is state.model
    assert fact in notice(again)


def test_a_damaged_file_leaves_the_model(file):
    begin = begun(pg.Model.serial(1))
    state = answered(begin, do.OpenAssembly(ME, file.name, file.read_text()[:9000]))
    assert state.model is begin.model
    assert "bars.step" in notice(state)
    assert state.clients[ME].assembly is None


def test_a_dropped_assembly_moves_after_two_clicks(page: Any, compiled: Server, file):
    opened(page, compiled, pg.Model.serial(1))
    drop(page, file.name, json.dumps([file.read_text()]))
    sheet = page.locator("dialog.pgraph-cad")
    sheet.wait_for()
    assert sheet.locator(".proposal").count() == 4
    assert "10 mm" in sheet.locator(".proposal").first.inner_text()
    sheet.locator(".proposal").first.hover()
    page.wait_for_function("pgraph.latest.selected?.length === 2")
    sheet.locator("[aria-label='base is fixed']").check()
    sheet.locator("[aria-label='density of all parts']").fill("2700")
    sheet.locator("button.accept").click()
    page.locator("dialog.pgraph-conversion:has-text('1 degree of freedom')").wait_for()
    model = compiled.store.state.model
    assert [body.joint for body in model.bodies] == ["weld", *["revolute"] * 3]
    assert len(model.constraints) == 1
    page.evaluate("pgraph.send('NewModel', {serial: 1, bodies: '2'})")
    sheet.wait_for(state="detached")
    page.get_by_role("button", name="Close", exact=True).last.click()

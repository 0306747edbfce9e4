"""The steps of docs/page.md: from New to a four-bar linkage that swings."""

from collections.abc import Callable
from typing import Any

from pgraph_app.playback import Pause
from pgraph_app.server import Server

from .conftest import NOBODY, until
from .on_page import ask, name_cell, pose_of_all, row

ROW_OF_FOCUS = "(name) => document.activeElement.closest('tr')?.dataset.name === name"


def create(page: Any) -> None:
    """New, three bodies."""
    ask(page, "new")
    page.keyboard.type("3")
    page.keyboard.press("Enter")
    page.wait_for_function("() => pgraph.latest.table.rows.length === 3")


def rename(page: Any) -> None:
    """Names, one below the other."""
    name_cell(page, "1").click()
    page.keyboard.press("F2")
    page.keyboard.press("Control+a")
    for name, below in (("crank", "2"), ("coupler", "3"), ("rocker", "rocker")):
        page.keyboard.type(name)
        page.keyboard.press("Enter")
        row(page, name).wait_for()
        page.wait_for_function(ROW_OF_FOCUS, arg=below)


def bend(page: Any) -> None:
    """The three joints, and that pose as the initial state."""
    cells = pose_of_all(page)
    until(lambda: cells.count() == 3, "all joints")
    cells.first.click()
    for angle, key in (("-1 rad", "Tab"), ("0.7 rad", "Tab"), ("1.3 rad", "Enter")):
        page.keyboard.type(angle)
        page.keyboard.press(key)
    page.wait_for_function("() => Math.abs(pgraph.latest.joints.rows[2].value - 1.3) < 1e-9")
    page.locator('.pgraph[data-view="joints"] button.use').click()


def close(page: Any) -> None:
    """A hinge between the rocker, selected, and the ground closes the loop: the cut joint."""
    row(page, "rocker").locator("td.number").click()
    page.get_by_role("tab", name="Connections").click()
    page.locator("button.add-tie").click()
    page.locator('[data-kind="loops revolute"]').click()
    page.locator('.pgraph-banner button:text-is("ground")').click()
    page.locator('.pgraph[data-view="constraints"] .tie.open').wait_for()


def play(page: Any) -> None:
    """Computed, and shown."""
    page.locator("button.play").click()


STEPS: tuple[Callable[[Any], None], ...] = (create, rename, bend, close, play)


def test_a_four_bar_is_made_from_new_to_play(page: Any, served: Server, compiled: Server):
    for step in STEPS:
        step(page)
    until(lambda: served.store.state.playback.time > 0, "a picture that moves")
    served.send(Pause(NOBODY))
    model, run = served.store.state.model, served.store.state.run
    assert [body.parent for body in model.bodies] == ["ground", "crank", "coupler"]
    assert [c.kind for c in model.constraints] == ["revolute"]
    assert model.body("coupler").q == (0.7,)
    assert run is not None
    result = run.result
    assert result.status.ok
    assert abs(result.q[-1] - result.q[0]).max() > 0.1  # it swings
    assert result.constraint_drift[:, 0].max() < 1e-6  # [m] the loop stays closed

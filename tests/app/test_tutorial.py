"""docs/tutorial.md as a person does it: from New to a simulated four-bar, by clicks and keys.

The seconds are those of the keystroke-level model [Card, Moran, Newell 1980]: a key, a click with
the way to it, and a thought before each step. The test itself does not wait for them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pgraph_app import events
from pgraph_app.server import Server

from .conftest import NOBODY, until

KEY, CLICK, THOUGHT = 0.2, 1.3, 1.35  # [s] a key; point (1.1) and press (0.2); before each step
BUDGET = 60.0  # [s]
ROW_OF_FOCUS = "(name) => document.activeElement.closest('tr')?.dataset.name === name"


@dataclass
class Person:
    """Hands on a page, and how long they would take."""

    page: Any
    seconds: float = 0.0

    def think(self) -> None:
        self.seconds += THOUGHT

    def click(self, what: str) -> None:
        self.page.locator(what).first.click()
        self.seconds += CLICK

    def write(self, text: str, *, then: str = "Enter") -> None:
        """Into the cell that has the focus; then the key that ends it."""
        self.page.keyboard.type(text)
        self.page.keyboard.press(then)
        self.seconds += KEY * (len(text) + 1)


def create(person: Person) -> None:
    """New, three bodies."""
    person.click("button.new")
    person.write("3")
    person.page.wait_for_function("() => pgraph.latest.table.rows.length === 3")


def rename(person: Person) -> None:
    """Names, one below the other."""
    person.click('tr[data-name="1"] input.name')
    person.page.keyboard.press("F2")
    person.page.keyboard.press("Control+a")
    person.seconds += 2 * KEY
    for name, below in (("crank", "2"), ("coupler", "3"), ("rocker", "rocker")):
        person.write(name)
        person.page.locator(f'tr[data-name="{name}"]').wait_for()
        person.page.wait_for_function(ROW_OF_FOCUS, arg=below)


def bend(person: Person) -> None:
    """The three joints in degrees, and that pose as the initial state."""
    person.click('[role="tab"][title="Pose"]')
    person.click('.pgraph[data-view="joints"] .joint:nth-child(1) .cell')
    for angle in ("-1", "0.7"):
        person.write(angle, then="Tab")
        person.page.keyboard.press("Tab")  # over the next name
        person.page.keyboard.press("Tab")  # and its slider
        person.seconds += 2 * KEY
    person.write("1.3")
    person.page.wait_for_function("() => Math.abs(pgraph.latest.joints.rows[2].value - 1.3) < 1e-9")
    person.click('.pgraph[data-view="joints"] button.use')


def close(person: Person) -> None:
    """A hinge between the rocker, selected, and the ground closes the loop: the cut joint."""
    person.click('[role="tab"][title="Constraints"]')
    person.click("button.add-tie")
    person.click('[data-kind="loops revolute"]')
    person.click('.pgraph-banner button:text-is("ground")')
    person.page.locator(".tie.open").wait_for()


def simulate(person: Person) -> None:
    """A free run, and play."""
    person.click("button.simulate")
    person.page.locator(".summary dd").first.wait_for(timeout=60_000)
    person.click("button.play")


STEPS: tuple[Callable[[Person], None], ...] = (create, rename, bend, close, simulate)


def test_a_four_bar_from_new_to_play_takes_a_person_less_than_a_minute(page: Any, served: Server):
    until(lambda: served.store.state.kernels.ready, "compiled kernels", seconds=300)
    person = Person(page)
    for step in STEPS:
        person.think()
        step(person)
    until(lambda: served.store.state.playback.time > 0, "a picture that moves")
    served.send(events.Pause(NOBODY))
    page.get_by_role("tab", name="Properties").click()
    page.get_by_role("tab", name="Digraph").click()
    model, run = served.store.state.model, served.store.state.run
    assert [body.parent for body in model.bodies] == ["ground", "crank", "coupler"]
    assert [c.kind for c in model.constraints] == ["revolute"]
    assert model.body("coupler").q == (0.7,)
    assert run is not None
    result = run.result
    assert result.status.ok
    assert abs(result.q[-1] - result.q[0]).max() > 0.1  # it swings
    assert result.constraint_drift[:, 0].max() < 1e-6  # [m] the loop stays closed
    assert person.seconds < BUDGET

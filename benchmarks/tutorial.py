"""docs/tutorial.md as a person does it: from New to a simulated four-bar, by clicks and keys.

The seconds are those of the keystroke-level model [Card, Moran, Newell 1980]: a key, a click after
pointing, and a thought before each step. Nothing here waits for them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

KEY, CLICK, THOUGHT = 0.2, 1.3, 1.35  # [s] a key; point (1.1) and press (0.2); before each step
ROW_OF_FOCUS = "(name) => document.activeElement.closest('tr')?.dataset.name === name"


@dataclass
class Person:
    """Clicks and keys on a page, and the time that a person would take."""

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
    person.page.locator('.pgraph[data-view="constraints"] .tie.open').wait_for()


def simulate(person: Person) -> None:
    """A free run, and play."""
    person.click("button.simulate")
    person.page.locator(".summary dd").first.wait_for(timeout=60_000)
    person.click("button.play")


STEPS: tuple[Callable[[Person], None], ...] = (create, rename, bend, close, simulate)

"""A wheeled inverted pendulum is built and balanced on the page, its clicks and keys counted."""

from typing import Any

import numpy as np
import pytest

from pgraph_app.server import Server

from .conftest import until
from .on_page import ask, chosen, field, part_field, row

MOST_CLICKS, MOST_KEYS = 60, 120


class Person:
    """A person at the page, whose clicks and keys are counted. A choice takes two clicks."""

    def __init__(self, page: Any):
        self.page, self.clicks, self.keys = page, 0, 0

    def click(self, what: Any) -> None:
        what.click()
        self.clicks += 1

    def choose(self, cell: Any, value: str) -> None:
        chosen(cell, value)
        self.clicks += 2

    def type(self, text: str, key: str = "Enter") -> None:
        self.page.keyboard.type(text)
        self.page.keyboard.press(key)
        self.keys += len(text) + 1

    def fill(self, cell: Any, text: str) -> None:
        """Click a cell, which selects its text, and type another one."""
        self.click(cell)
        self.type(text)
        until(lambda: not cell.evaluate("(one) => one.matches('.waiting, .refused')"), "taken")


def body_of(served: Server, name: str) -> Any:
    return served.store.state.model.body(name)


def build(one: Person, served: Server) -> None:
    """An axle on a rail, a rod upright on it, a wheel that the rod carries and that rolls."""
    page = one.page
    ask(page, "new")
    one.clicks += 2
    one.type("3")
    page.wait_for_function("() => pgraph.latest.table.rows.length === 3")

    def select(name: str) -> None:
        one.click(row(page, name).locator("td.number"))
        page.wait_for_function("(n) => pgraph.latest.properties.bodies.join() === n", arg=name)

    def opened(what: Any) -> Any:
        if not what.is_visible():
            title = page.locator("[data-view=properties] details:not([open])").filter(has=what)
            one.click(title.locator("summary"))
        return what

    select("1")
    one.choose(opened(field(page, "joint")), "prismatic")
    until(lambda: body_of(served, "1").joint == "prismatic", "an axle that slides")
    one.fill(opened(field(page, "axes")), "x")
    until(lambda: body_of(served, "1").axes == ((1, 0, 0),), "along x")
    for name, com in (("2", "0 0 0.5"), ("3", "0 0 0")):
        select(name)
        one.fill(opened(field(page, "link")), "0 0 0")
        until(lambda n=name: body_of(served, n).link == (0, 0, 0), "on the axle")
        one.fill(opened(field(page, "com")), com)
        until(lambda n=name, c=com: body_of(served, n).com[2] == float(c[4:]), "its centre")
    one.click(page.get_by_role("tab", name="Connections"))
    one.click(page.locator("button.add-tie"))
    one.click(page.locator('[data-kind="constraints coupling"]'))
    for name, count in (("1", 2), ("2", 3)):
        last = page.locator('[data-view=part] [data-field="coefficients"] select')
        last.wait_for()
        one.choose(last, name)
        until(lambda n=count: len(served.store.state.model.constraints[0].coefficients) == n, name)
        rows = """(n) => document.querySelectorAll(
          "[data-view=part] [data-field=coefficients]").length === n"""
        page.wait_for_function(rows, arg=count + 1)  # one for each body, and "+ body"
    for name, value in (("3", "-0.1"), ("2", "-0.1")):
        known = list(served.store.state.model.constraints[0].coefficients)
        one.fill(part_field(page, "coefficients", known.index(name)), value)
        coupling = lambda n=name: served.store.state.model.constraints[0].coefficients[n]  # noqa: E731
        until(lambda v=value, of=coupling: of() == (float(v),), "a radius of 0.1 m")
    one.click(page.locator("button.add-tie"))
    one.click(page.locator('[data-kind="forces motor"]'))
    part_field(page, "torque").wait_for()


@pytest.mark.nightly  # its parts are tested without a browser, and other ways through the page here
def test_a_newcomer_balances_a_wheeled_pendulum(page: Any, served: Server, compiled: Server):
    one = Person(page)
    build(one, served)
    one.click(page.get_by_role("button", name="feedback …"))
    dialog = page.get_by_role("dialog", name="State feedback")
    dialog.locator(".gains").wait_for()
    assert dialog.locator("svg path.line").count() == 3
    one.click(dialog.locator("button.add-feedback"))
    dialog.wait_for(state="detached")
    state = served.store.state
    assert str(state.model.forces[0].torque).startswith("=")  # type: ignore[attr-defined]
    one.click(page.get_by_role("tab", name="Bodies"))
    one.click(row(page, "2").locator("td.number"))
    pose = page.locator('[data-view=joints] .cell[aria-label^="2 about y"]')
    pose.wait_for()
    one.fill(pose, "5 deg")
    one.click(page.locator('.pgraph[data-view="joints"] button.use'))
    until(lambda: abs(body_of(served, "2").q[0] - np.radians(5)) < 1e-3, "a tilted rod")
    one.click(page.locator("button.play"))
    until(lambda: served.store.state.run is not None, "a run")
    run = served.store.state.run.result
    assert run.status.ok
    assert abs(run.q[0, 1]) > 0.08
    assert abs(run.q[-1, 1]) < 0.02  # [rad] it is about to stand after 2 s
    assert one.clicks <= MOST_CLICKS, one.clicks
    assert one.keys <= MOST_KEYS, one.keys
    print("clicks", one.clicks, "keys", one.keys)

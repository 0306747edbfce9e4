"""Expressions typed in cells: completion, values, faults, and signals picked by clicks."""

from typing import Any

import pytest

import pgraph_core as pg
from pgraph_app.server import Server

from .conftest import opened, until
from .on_page import middle_of, node, on_screen, part_field, row, simulate


def cart_pole() -> pg.Model:
    bodies = [
        pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], q=0.5),
        pg.Body(name="pole", parent="cart", axes=[(0, 1, 0)], com=(0, 0, 0.5), tip=(0, 0, 1),
                inertia=(0.1, 0.1, 0.1), q=0.2),
    ]  # fmt: skip
    return pg.Model(
        bodies=bodies, forces=[pg.Motor(name="push", body="cart")], name="cart pole",
        parameters={"kick": 3.0},
        outputs=[pg.Output(name="tilt", kind="joint_position", at="pole")],
    )  # fmt: skip


@pytest.fixture
def torque(page: Any, served: Server) -> Any:
    """The torque of the motor, empty and in focus."""
    opened(page, served, cart_pole())
    page.evaluate("pgraph.send('OpenPart', { part: 'forces', name: 'push' })")
    cell = part_field(page, "torque")
    cell.click()
    cell.fill("")
    yield cell
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")


def options(page: Any) -> Any:
    return page.locator("#pgraph-words [role=option] span:first-child")


def lists(page: Any, *wanted: str) -> None:
    until(lambda: options(page).all_inner_texts() == [*wanted], f"the list {wanted}")


def says(page: Any, *parts: str) -> None:
    status = page.locator(".pgraph-typed [role=status]")
    until(lambda: status.count() and all(p in status.inner_text() for p in parts), str(parts))


def torque_of(served: Server) -> Any:
    (motor,) = served.store.state.model.forces
    assert isinstance(motor, pg.Motor)
    return motor.torque


def test_names_are_completed_by_keyboard_and_pointer(page, served, torque):
    page.keyboard.type("=-20*q.p")
    lists(page, "q.pole")
    page.keyboard.press("Enter")
    until(lambda: torque.input_value() == "=-20*q.pole", "the name")
    says(page, "N", "now -4 N")
    page.keyboard.type(" - 3*v.")
    lists(page, "v.cart", "v.pole")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Tab")
    until(lambda: torque.input_value() == "=-20*q.pole - 3*v.pole", "the second")
    page.keyboard.type(" + k")
    lists(page, "kick")
    options(page).first.click()
    until(lambda: torque.input_value().endswith("kick"), "the parameter")
    assert page.locator("#pgraph-words").get_attribute("role") == "listbox"
    page.keyboard.press("Enter")
    until(lambda: torque_of(served) == "=-20*q.pole - 3*v.pole + kick", "the torque")
    row(page, "cart").locator("td.number").click()  # which went into the expression that was taken
    page.wait_for_function("() => pgraph.latest.properties.bodies.join() === 'cart'")
    assert torque_of(served) == "=-20*q.pole - 3*v.pole + kick"


def test_escape_closes_the_list_and_then_restores_the_cell(page, served, torque):
    page.keyboard.type("=2*q.")
    lists(page, "q.cart", "q.pole")
    page.keyboard.press("Escape")
    lists(page)
    assert torque.input_value() == "=2*q."
    page.keyboard.press("Escape")
    until(lambda: torque.input_value() == "0", "the value before")
    assert torque_of(served) == 0.0


def test_what_is_wrong_is_said_beside_the_cell_and_nothing_is_lost(page, served, torque):
    for text, *parts in (
        ("=q.pole + v.pole", "fit"),
        ("=3*q.pool", "pool", "pole"),
        ("=q.cart", "N", "factor"),
        ("=" + "1+" * 1500 + "1", "2000"),
    ):
        torque.fill(text)
        says(page, *parts)
        page.keyboard.press("Enter")
        page.locator("[data-view=part] .sentence").wait_for()
        assert torque.input_value() == text
        assert torque_of(served) == 0.0
    sentence = page.locator("[data-view=part] .sentence")
    for text in ("=" + "x" * 200_000, "7" * 200_000):  # pasted
        torque.fill(text)
        page.keyboard.press("Enter")
        until(lambda: sentence.count() and "characters" in sentence.inner_text(), "a sentence")
        assert len(torque.input_value()) == len(text)
    torque.fill("=3*q.pole")
    page.keyboard.press("Enter")
    until(lambda: torque_of(served) == "=3*q.pole", "it is taken")


def test_a_signal_is_picked_by_clicks(page, served, compiled, torque):
    """A row, a node, a speed, a sensor, a body in the 3D view, a curve."""
    torque.fill("=1*")
    row(page, "pole").locator("td.number").click()
    until(lambda: torque.input_value() == "=1*q.pole", "the row")
    page.keyboard.type(" + 2*")
    row(page, "cart").locator("td.number").click(modifiers=["Shift"])
    until(lambda: torque.input_value() == "=1*q.pole + 2*v.cart", "its speed")
    page.keyboard.type(" + 3*v.")
    row(page, "pole").locator("td.number").click()
    until(lambda: torque.input_value().endswith("3*v.pole"), "what was begun")
    assert served.store.state.clients[max(served.store.state.clients)].selection is None
    page.evaluate("pgraph.front('Connections')")
    page.keyboard.type(" + 4*")
    page.locator('[data-part="outputs"] .tie .title').click()
    until(lambda: torque.input_value().endswith("4*out.tilt"), "the sensor")
    page.keyboard.type(" + 5*")
    page.mouse.click(*on_screen(page, middle_of(served, "pole")))
    until(lambda: torque.input_value().endswith("5*q.pole"), "the body in 3D")
    page.keyboard.press("Enter")
    until(lambda: str(torque_of(served)).endswith("5*q.pole"), "the torque")
    simulate(page)
    until(lambda: served.store.state.run is not None, "a run")
    page.evaluate("pgraph.send('Plot', { kind: 'v', of: 'pole', on: true })")
    page.evaluate("pgraph.front('Plots')")
    plot = page.locator('figure.plot[data-kind="v"]')
    plot.wait_for()
    torque.fill("=7*")
    plot.locator("canvas").click()
    until(lambda: torque.input_value() == "=7*v.pole", "the curve")

    def escaped() -> bool:  # the first press may close a list that has just opened
        page.keyboard.press("Escape")
        return torque.input_value().endswith("5*q.pole")

    until(escaped, "the torque before")
    torque.blur()
    until(lambda: served.store.state.clients[max(served.store.state.clients)].aim is None, "no aim")
    page.evaluate("pgraph.send('Plot', { kind: 'v', of: 'pole', on: false })")
    page.evaluate("pgraph.frame.drawer(false); pgraph.front('Bodies')")


@pytest.mark.nightly
def test_a_node_of_the_digraph_is_a_signal(page, served, torque):
    torque.fill("=2*")
    if not node(page, "pole").is_visible():
        page.evaluate("document.querySelector('[data-view=digraph] svg')?.scrollIntoView()")
    node(page, "pole").dispatch_event("pointerdown", {"button": 0, "bubbles": True})
    until(lambda: torque.input_value() == "=2*q.pole", "the node")

"""The tab of searches in a browser: data, free numbers, the result and its use."""

import threading
from typing import Any

from pgraph_app.search import Choices

from .conftest import opened, until
from .on_page import choose_body, chosen, field, in_sight, typed
from .test_search import curves, pendulum


def test_data_are_dropped_matched_fitted_and_used(page: Any, served: Any, compiled: Any):
    opened(page, served, pendulum(damping=0.2, q=[1.0]))
    page.evaluate("pgraph.front('Fit')")
    start = page.locator("button.start-search")
    until(start.is_disabled, "a search that lacks data")
    assert "measured curves" in page.locator("[data-view=search] .said").inner_text()
    page.locator("[data-view=search] input[type=file]").set_input_files(
        {"name": "swing.csv", "mimeType": "text/csv", "buffer": curves().encode()}
    )
    chosen(page.get_by_label("signal of angle", exact=True), "rod")
    page.get_by_label("numbers to find").click()
    for path in ("bodies.rod.damping", "q.rod"):
        page.get_by_label(f"{path} is free", exact=True).check()
    start.click()
    page.locator(".search-result button.use-found").wait_for()
    assert page.locator(".search-curves svg .line").count() == 1
    before = served.store.state.model
    page.locator(".search-result button.use-found").click()
    until(lambda: served.store.state.model is not before, "the numbers in the model")
    assert abs(served.store.state.model.body("rod").q[0] - 1.2) < 0.01


def test_a_tab_of_a_former_model_offers_nothing_until_it_is_shown(page: Any, served: Any):
    """It is not drawn while it is hidden."""
    host = page.locator("[data-view=search]")
    numbers = "() => pgraph.latest.choices.numbers.map(({ name }) => name)"
    page.evaluate("pgraph.front('Fit')")
    until(lambda: in_sight(served, "search"), "the tab in sight")
    host.locator("button.start-search").wait_for()
    page.evaluate("pgraph.front('Plots')")
    until(lambda: not in_sight(served, "search"), "the tab to be hidden")
    opened(page, served, pendulum(damping=0.2, q=[1.0]))
    assert host.evaluate("(host) => host.children.length") == 0
    assert not any("rod" in name for name in page.evaluate(numbers))
    page.evaluate("pgraph.front('Fit')")
    host.locator("button.start-search").wait_for()
    until(lambda: "q.rod" in page.evaluate(numbers), "the numbers of the model")


def test_the_tab_waits_for_its_numbers_while_the_model_is_edited(
    page: Any, served: Any, compiled: Any, monkeypatch: Any
):
    gate, find = threading.Event(), Choices.find
    monkeypatch.setattr(Choices, "find", lambda model: (gate.wait(), find(model))[1])
    try:
        opened(page, served, pendulum())
        page.evaluate("pgraph.front('Fit')")
        page.locator("[data-view=search] .waits").wait_for()
        choose_body(page, "rod")
        typed(field(page, "mass"), "3")
        until(lambda: served.store.state.model.body("rod").mass == 3, "an edit meanwhile")
    finally:
        gate.set()
    page.locator("[data-view=search] .waits").wait_for(state="hidden")
    values = "() => pgraph.latest.choices.numbers.map(({ name, value }) => name + value)"
    assert "bodies.rod.mass3" in page.evaluate(values)

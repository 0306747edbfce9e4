"""The tab of searches in a browser: data, free numbers, the result and its use."""

from typing import Any

from .conftest import opened, until
from .on_page import chosen, in_sight
from .test_search import curves, pendulum


def test_data_are_dropped_matched_fitted_and_used(page: Any, served: Any, compiled: Any):
    opened(page, served, pendulum(damping=0.2, q=[1.0]))
    page.evaluate("pgraph.front('Fit')")
    start = page.locator("button.start-search")
    until(start.is_disabled, "a search that lacks data")
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
    numbers = "() => pgraph.latest.search.numbers.map(({ name }) => name)"
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
    assert "q.rod" in page.evaluate(numbers)

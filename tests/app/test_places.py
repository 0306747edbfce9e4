"""Where views are on the page: found by folder, drawn in the order in which answers need it."""

from __future__ import annotations

from pgraph_app.features import APP, places


def test_a_view_of_every_folder_is_on_the_page():
    modules = {place.make.__module__.split(".")[-2] for place in places()}
    assert modules == {path.parent.name for path in APP.glob("*/view.py")}


def test_no_two_views_have_one_order_and_the_session_is_drawn_last():
    """An answer to a cell comes after the value it is about."""
    ordered = sorted(places(), key=lambda place: place.order)
    assert len({place.order for place in ordered}) == len(ordered)
    assert ordered[-1].make.__module__.endswith("session.view")

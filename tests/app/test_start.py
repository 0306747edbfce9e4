"""The start of the page."""

import threading
import urllib.request

import pgraph_core as pg
from pgraph_app import server


def test_a_browser_that_returns_late_holds_up_nothing(monkeypatch, tmp_path):
    opened, closed = threading.Event(), threading.Event()
    monkeypatch.setattr(server.webbrowser, "open", lambda url: opened.set() or closed.wait())
    page = server.serve(pg.Model.serial(1), port=0)
    try:
        assert opened.wait(120)
        with urllib.request.urlopen(page.url, timeout=120) as answer:
            assert answer.status == 200
    finally:
        closed.set()
        page.stop()

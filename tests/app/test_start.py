"""The start of the page: what it waits for, and what it does not."""

import threading
import urllib.request

import pytest

import pgraph_core as pg
from pgraph_app import server
from pgraph_app.run import Compiled, Compiling, worker
from pgraph_app.run.worker import Compiler, why_compiled
from pgraph_core.engine.compiler.archive import Archive

from .store import until


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


def events_of(code: str, why: str) -> list[object]:
    """Return what a compiler sends whose process runs this code."""
    sent: list[object] = []
    Compiler(sent.append, ("-c", code), lambda: why)
    until(lambda: any(isinstance(event, Compiled) for event in sent), "the end of the compiler")
    return sent


def test_no_process_is_started_where_the_package_brings_the_kernels():
    assert events_of("raise SystemExit('started')", "") == [Compiled()]


def test_progress_goes_to_the_page_and_reasons_to_the_terminal(capfd):
    code = "print('1 2 a'); print('it is damaged'); print('2 2 b c'); print('12 words')"
    sent = events_of(code, "it is damaged")
    assert sent == [Compiling(1, 2, "a"), Compiling(2, 2, "b c"), Compiled()]
    assert capfd.readouterr().err.splitlines() == ["it is damaged", "12 words"]


@pytest.mark.parametrize(
    "code", ["raise SystemExit('no disk')", "print('1 2 a'); raise SystemExit('no disk')"]
)
def test_a_failure_reaches_the_page(code, capfd):
    assert events_of(code, "it is damaged")[-1] == Compiled("no disk")
    assert "no disk" in capfd.readouterr().err


@pytest.mark.parametrize("content", [None, b"", b"\0" * 100])
def test_an_archive_that_cannot_be_used_is_a_reason(tmp_path, monkeypatch, content):
    path = tmp_path / "kernels.archive"
    if content is not None:
        path.write_bytes(content)
    monkeypatch.setattr(worker, "current", lambda: Archive(path))
    assert "archive" in why_compiled()


def test_the_address_of_a_host_of_version_6_is_in_brackets(monkeypatch):
    """Browsers take `http://::1:8080/` for an invalid address."""
    try:
        page = server.serve(pg.Model.serial(1), host="::1", port=0, open_browser=False)
    except OSError:
        pytest.skip("this machine has no addresses of version 6")
    try:
        assert page.url.startswith("http://[::1]:")
        with urllib.request.urlopen(page.url, timeout=120) as answer:
            assert answer.status == 200
    finally:
        page.stop()

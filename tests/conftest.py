"""Settings, markers and clean-up for all tests."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator

import pytest
from hypothesis import settings

# A shared machine may pause for seconds: no deadline a case. `make test` tries the same cases every
# time; `make nightly` looks for new ones.
explore = bool(os.environ.get("PGRAPH_EXPLORE"))
settings.register_profile("pgraph", deadline=None, derandomize=not explore)
settings.load_profile("pgraph")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that use a browser, directly or through a fixture, carry the marker `browser`."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)


COMPUTING = {"pgraph-live", "pgraph-run", "pgraph-report"}  # threads of the page


@pytest.fixture(autouse=True)
def nothing_goes_on() -> Iterator[None]:
    """Waits until the threads of a test end: other tests count objects, memory and time."""
    yield
    end = time.monotonic() + 30
    while left := [t.name for t in threading.enumerate() if t.name in COMPUTING]:
        assert time.monotonic() < end, f"still computing after the test: {left}"
        time.sleep(0.01)

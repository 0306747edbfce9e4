"""Settings, markers and clean-up for all tests."""

import os
import threading
import time
from collections.abc import Iterator

import pytest
from hypothesis import settings

# `make test` tries the same random cases every time, and `make nightly` tries more and new ones. A
# case has no deadline, because a shared machine may pause for seconds.
explore = bool(os.environ.get("PGRAPH_EXPLORE"))
settings.register_profile(
    "pgraph", deadline=None, derandomize=not explore, max_examples=100 if explore else 40
)
settings.load_profile("pgraph")

# they compute for the page
PAGE_THREADS = {"pgraph-live", "pgraph-simulation", "pgraph-report", "pgraph-search"}
LIMIT = 120.0  # [s] time after which a thread counts as hung, usually milliseconds


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark each test that uses a browser, directly or through a fixture, as `browser`."""
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(autouse=True)
def no_thread_left() -> Iterator[None]:
    """Wait until the computing threads of a test have ended, so that the next test starts clean."""
    yield
    end = time.monotonic() + LIMIT
    while left := [t.name for t in threading.enumerate() if t.name in PAGE_THREADS]:
        assert time.monotonic() < end, f"still computing after the test: {left}"
        time.sleep(0.01)

"""What all tests share."""

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

COMPUTING = {"pgraph-live", "pgraph-run", "pgraph-report"}  # threads of the page


@pytest.fixture(autouse=True)
def nothing_goes_on() -> Iterator[None]:
    """What a test has started ends with it: others count objects, memory and time."""
    yield
    end = time.monotonic() + 30
    while left := [t.name for t in threading.enumerate() if t.name in COMPUTING]:
        assert time.monotonic() < end, f"still computing after the test: {left}"
        time.sleep(0.01)

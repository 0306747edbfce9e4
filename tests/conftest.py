"""What all tests share."""

from __future__ import annotations

import os

from hypothesis import settings

# A shared machine may pause for seconds: no deadline a case; CI reproduces the same cases.
settings.register_profile("pgraph", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("pgraph")

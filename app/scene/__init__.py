"""The 3D view."""

from __future__ import annotations

SHOWN_AT_FIRST = frozenset({"shapes", "joining", "sites", "branches", "forces"})

"""The machine of a measurement, and the packages that are installed on it."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from importlib.metadata import distributions
from pathlib import Path

from pgraph_core.engine.compiler.lane import LANE_WIDTH
from pgraph_core.study import measures

ROOT = Path(__file__).parent.parent
PACKAGES = ("pgraph-dynamics", "numpy", "numba")


def machine(peers: Iterable[str] = ()) -> dict[str, str | int]:
    """CPU, cores, doubles in a vector register, versions of Python and packages, our commit."""
    found = measures.machine((*PACKAGES, *peers))
    return {"cpu": found.pop("cpu"), "lanes": LANE_WIDTH, **found, "commit": commit()}


def has(package: str) -> bool:
    """Return whether a package is installed."""
    return any(distributions(name=package))


def absent(packages: Iterable[str]) -> list[str]:
    """Return those that are not installed."""
    return [package for package in packages if not has(package)]


def commit() -> str:
    """Short hash of the commit, with a plus where the package differs from it."""
    try:
        changed = _git("status", "--porcelain", "--", "pgraph_core")
        return _git("rev-parse", "--short", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()

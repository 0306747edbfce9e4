"""The machine of a measurement, and the peers that are installed."""

from __future__ import annotations

import subprocess
from importlib.util import find_spec
from pathlib import Path

from pgraph_core.engine.compiler.lane import LANE_WIDTH
from pgraph_core.study import measures

ROOT = Path(__file__).parent.parent
PEERS = {  # package: what it imports
    "mujoco": "mujoco",
    "pin": "pinocchio",
    "drake": "pydrake",
    "exudyn": "exudyn",
}
PACKAGES = ("pgraph-dynamics", "numpy", "numba", *PEERS)


def machine() -> dict[str, str | int]:
    """CPU model, cores, doubles in a vector register, Python and package versions, our commit."""
    found = measures.machine(PACKAGES)
    return {"cpu": found.pop("cpu"), "lanes": LANE_WIDTH, **found, "commit": commit()}


def has(peer: str) -> bool:
    """Whether a peer can be imported."""
    return find_spec(PEERS[peer]) is not None


def absent() -> list[str]:
    """Packages of peers that are not installed."""
    return [peer for peer in PEERS if not has(peer)]


def commit() -> str:
    """Short hash of the commit, with a plus where kernels or core differ from it."""
    try:
        head = _git("rev-parse", "--short", "HEAD")
        return head + ("+" if _git("status", "--porcelain", "--", "pgraph_core") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()

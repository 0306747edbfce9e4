"""What the numbers were measured on, and which peers are there."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).parent.parent
PEERS = {  # package: what it imports
    "mujoco": "mujoco",
    "pin": "pinocchio",
    "drake": "pydrake",
    "exudyn": "exudyn",
}
PACKAGES = ("pgraph", "numpy", "numba", *PEERS)


def machine() -> dict[str, str | int]:
    """CPU model, cores, Python and package versions, our commit."""
    return {
        "cpu": cpu(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1,
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
        "commit": commit(),
    }


def has(peer: str) -> bool:
    """Whether a peer can be imported."""
    return find_spec(PEERS[peer]) is not None


def absent() -> list[str]:
    """Packages of peers that are not installed."""
    return [peer for peer in PEERS if not has(peer)]


def cpu() -> str:
    """The CPU's model name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


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


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"

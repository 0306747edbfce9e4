"""Models of robots that others publish as Python wheels: downloaded when the nightly tests run.

They are read from a folder of the user's cache, never kept in the repository. `REGISTRY` lists the
packages with their versions.
"""

import os
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import numpy as np

REGISTRY = {
    "example-robot-data": "6.0.0",
    "gymnasium": "1.4.0",
    "gymnasium-robotics": "1.4.2",
    "dm-control": "1.0.50",
    "robosuite": "1.5.2",
    "pybullet": "3.2.7",
}
PLACE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "pgraph" / "models"


@cache
def folder(package: str) -> Path | None:
    """Return the unpacked wheel of a package, or None if it cannot be downloaded."""
    version = REGISTRY[package]
    place = PLACE / f"{package}-{version}"
    if not (place / "done").exists():
        place.mkdir(parents=True, exist_ok=True)
        words = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        words += ["--only-binary", ":all:", "--dest", str(place), f"{package}=={version}"]
        try:
            subprocess.run(words, check=True, capture_output=True, timeout=900)
        except (subprocess.SubprocessError, OSError):
            return None
        for wheel in place.glob("*.whl"):
            zipfile.ZipFile(wheel).extractall(place)
            wheel.unlink()
        (place / "done").touch()
    return place


def files(package: str, ending: str) -> list[Path]:
    """Return the files of a package with this ending, [] if it cannot be downloaded."""
    place = folder(package)
    return sorted(place.rglob(f"*{ending}")) if place else []


def largest_error(found: np.ndarray, expected: np.ndarray, least: float = 0.0) -> float:
    """Largest difference, relative to the largest number, or to `least` where that is larger."""
    size = max(float(np.abs(expected).max(initial=0.0)), least) or 1.0
    return float(np.abs(found - expected).max(initial=0.0)) / size

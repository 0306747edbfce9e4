"""From the wheel to a moving mechanism in a bare environment: two commands of a stranger.

`pip install` of the wheel, then `pgraph export ... --live`, whose file moves in any browser.
Kernels are compiled again, into a cache of their own.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Iterator, Sequence
from pathlib import Path

from .machine import ROOT
from .measure import Effort, Row

MINUTES = 2.0
PIP = ("--disable-pip-version-check", "--quiet")


def rows(effort: Effort) -> Iterator[Row]:
    """Quick: the export alone, by this environment and with the kernels that it has."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arguments = ("export", "double_pendulum", "--live", "-o", "a.html")
        if effort.quick:
            words = (sys.executable, "-m", "pgraph_app", *arguments)
            yield taken("pgraph export --live", words, folder, dict(os.environ))
            return
        pip = [sys.executable, "-m", "pip", *PIP]
        environment = {**os.environ, "PGRAPH_CACHE": str(folder / "kernels")}
        taken("", [*pip, "wheel", "--no-deps", "-w", folder, ROOT], folder, environment)
        (wheel,) = folder.glob("*.whl")
        venv.create(folder / "bare", with_pip=True)
        there = folder / "bare" / "bin"
        export = (there / "pgraph", *arguments)
        for label, words in (
            ("pip install", (there / "python", "-m", "pip", *PIP, "install", wheel)),
            ("pgraph export --live", export),
            ("pgraph export --live again", export),
        ):
            yield taken(label, words, folder, environment)


def taken(label: str, words: Sequence[str | Path], folder: Path, environment: dict) -> Row:
    """Seconds by the clock and of processor time. Raises CalledProcessError."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(words, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    after, ended = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"case": label, "by the clock [s]": ended - began, "processor [s]": processor}

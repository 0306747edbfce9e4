"""From the wheel to a moving mechanism in a bare environment: `python -m benchmarks.first_use`.

Two commands of a stranger: `pip install` of the wheel, then `pgraph export ... --live`, whose file
moves in any browser. Kernels are compiled again, into a cache of their own.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Sequence
from pathlib import Path

from .machine import ROOT, machine

PIP = ("--disable-pip-version-check", "--quiet")


def taken(words: Sequence[str | Path], folder: Path) -> tuple[float, float]:
    """(seconds by the clock, of processor time) of a command. Raises CalledProcessError."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    environment = {**os.environ, "PGRAPH_CACHE": str(folder / "kernels")}
    subprocess.run(words, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, spent


def main() -> None:
    """Print a table."""
    print(", ".join(f"{name}: {value}" for name, value in machine().items()))
    print("| command | by the clock [s] | processor [s] |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pip = [sys.executable, "-m", "pip", *PIP]
        taken([*pip, "wheel", "--no-deps", "-w", folder, ROOT], folder)
        (wheel,) = folder.glob("*.whl")
        venv.create(folder / "bare", with_pip=True)
        there = folder / "bare" / "bin"
        export = (there / "pgraph", "export", "double_pendulum", "--live", "-o", "a.html")
        for label, words in (
            ("pip install", (there / "python", "-m", "pip", *PIP, "install", wheel)),
            ("pgraph export --live", export),
            ("again", export),
        ):
            clock, processor = taken(words, folder)
            print(f"| {label} | {clock:.1f} | {processor:.1f} |", flush=True)


if __name__ == "__main__":
    main()

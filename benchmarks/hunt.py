"""docs/hunt.md from the runs of a hunt.

`pgraph hunt --json > hunt.json`, then `python -m benchmarks.hunt hunt.json` prints the page.
Several files may be given: pieces of a hunt by `--first`, and other seeds.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pgraph_core.verification.hunt import FAMILIES, SMOOTH

from .machine import machine

INTRODUCTION = """# Random tests: what is wrong and silent

`pgraph hunt` draws random scenes over scales of mass, length, time and stiffness, and runs each by
default and by two other settings. A closed form, an integration by SciPy of equations of its own,
or, for trees, a far finer run knows the motion. A run is *right* if its error is at most ten times
its error estimate, or rounding; *told* if it is wrong and its status or a notice says so; otherwise
*wrong and silent*. `pgraph_core/verification` has the scenes, `tests/core/test_hunt.py` a slice of
them.

{scenes}, {runs} runs in {minutes:.0f} minutes on {cpu}: {verdicts}.
Made by `pgraph hunt --json` and `python -m benchmarks.hunt`.
"""
BINS = (0.0, 0.01, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, np.inf)
VERDICTS = ("right", "told", "refused", "unjudged", "silent")
BAR = 60


def ratios(runs: Sequence[dict[str, Any]]) -> np.ndarray:
    """Estimate over error of the smooth runs whose error is more than rounding, where known."""
    return np.array([
        run["estimate"] / run["error"]
        for run in runs
        if run["family"] in SMOOTH and run["verdict"] in ("right", "silent")
        and None not in (run["error"], run["estimate"]) and run["error"] > run["floor"]
    ])  # fmt: skip


def within(found: np.ndarray) -> str:
    """The share of ratios within 0.2 to 10, in words."""
    if not len(found):
        return ""
    return f"{100 * np.mean((found > 0.2) & (found < 10.0)):.1f} % of {len(found)}"


def histogram(found: np.ndarray) -> list[str]:
    """Bars of how often an estimate is so many times the error."""
    counts, _ = np.histogram(found, BINS)
    largest = max(int(counts.max(initial=1)), 1)
    lines = ["```text", "estimate / error"]
    for low, high, count in zip(BINS, BINS[1:], counts.tolist()):
        bar = "#" * -(-BAR * count // largest)
        lines.append(f"{low:>6g} to {high:<6g} {count:>5} {bar}")
    return [*lines, "```"]


def families(runs: Sequence[dict[str, Any]]) -> list[str]:
    """A row for each family."""
    lines = ["| family | " + " | ".join(VERDICTS) + " | estimate within 0.2 to 10 |"]
    lines.append("| --- " * (len(VERDICTS) + 2) + "|")
    names = dict.fromkeys((*FAMILIES, *(run["family"] for run in runs)))
    for family in names:
        own = [run for run in runs if run["family"] == family]
        counts = Counter(run["verdict"] for run in own)
        cells = [family, *(str(counts[verdict] or "") for verdict in VERDICTS), within(ratios(own))]
        if own:
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def said(runs: Sequence[dict[str, Any]]) -> list[str]:
    """What told runs say, numbers left out, and how often."""
    texts = Counter(
        re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "...", run["says"]).split(";")[0][:150]
        for run in runs
        if run["verdict"] in ("told", "refused")
    )
    return [f"* {count} x: {text}" for text, count in texts.most_common()]


def page(pieces: Sequence[dict[str, Any]]) -> str:
    """The page of one hunt, or of its pieces together."""
    runs = [run for piece in pieces for run in piece["runs"]]
    counts, scenes = Counter(run["verdict"] for run in runs), Counter[int]()
    for piece in pieces:
        scenes[piece["seed"]] += piece["scenes"]
    first = INTRODUCTION.format(
        scenes=" and ".join(f"{count} scenes of seed {seed}" for seed, count in scenes.items()),
        runs=len(runs), minutes=sum(piece["seconds"] for piece in pieces) / 60,
        cpu=machine()["cpu"],
        verdicts=", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS),
    )  # fmt: skip
    right = [run for run in runs if run["verdict"] == "right"]
    noticed = sum(bool(run["says"]) for run in right)
    return "\n".join((
        first, "## Families", "", *families(runs), "", "## Estimates of smooth runs", "",
        f"Within 0.2 to 10 times the error: {within(ratios(runs))} runs.", "",
        *histogram(ratios(runs)), "", "## What told runs say", "", *said(runs), "",
        f"Of {len(right)} right runs, {noticed} carry a notice too.",
    ))  # fmt: skip


if __name__ == "__main__":
    print(page([json.loads(Path(name).read_text(encoding="utf-8")) for name in sys.argv[1:]]))

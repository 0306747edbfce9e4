"""The committed baseline of ratios, and the ratios that fell below it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

PATH = Path(__file__).parent / "baseline.json"
FALL = 0.25  # of a ratio that fails the gate: what two shared cores do to a median stays below
Ratios = Mapping[str, float]


def ratios(rows: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Median ratio of every row where more is better, by 'case: side'."""
    return {
        f"{row['case']}: {row['side']}": round(row["ratio"][1], 3)
        for row in rows
        if row["ratio"] and not row["side"].startswith("pgraph")
    }


def fallen(now: Ratios, then: Ratios, fall: float = FALL) -> list[str]:
    """A sentence for every ratio more than `fall` below the baseline."""
    return [
        f"{name}: the ratio fell from {then[name]:.3g} to {value:.3g}"
        for name, value in now.items()
        if name in then and value < (1 - fall) * then[name]
    ]


def load(path: Path = PATH) -> dict[str, Any]:
    """The baseline: the CPU that it was made on, and its ratios."""
    if not path.exists():
        return {"cpu": "", "ratios": {}}
    return json.loads(path.read_text(encoding="utf-8"))


def updated(then: Mapping[str, Any], cpu: str, now: Ratios) -> dict[str, Any]:
    """The baseline with the new ratios; other ratios are kept if the CPU is the same."""
    kept = then["ratios"] if then["cpu"] == cpu else {}
    return {"cpu": cpu, "ratios": dict(sorted({**kept, **now}.items()))}


def save(baseline: Mapping[str, Any], path: Path = PATH) -> None:
    """Write it as text that diffs by row."""
    path.write_text(json.dumps(baseline, indent=2) + "\n", encoding="utf-8")


def verdict(now: Ratios, then: Mapping[str, Any], cpu: str) -> list[str]:
    """Every fallen ratio, and the CPU of the baseline if it is another one."""
    wrong = fallen(now, then["ratios"])
    if wrong and then["cpu"] != cpu:
        wrong.append(f"the baseline was made on {then['cpu']}, this is {cpu}")
    return wrong

"""The command for verifying Pgraph itself: `pgraph verify`."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import pgraph_core as pg
import pgraph_models

from .terminal import Answer, aligned, command, takes

HEADER = (
    "case", "compared", "error", "target", "reference", "time [s]", "steps", "method", "verdict"
)  # fmt: skip


def tell(text: str) -> None:
    """Print progress over the last line of a terminal, or do nothing if output is piped."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


@command(
    "verify",
    "compute known motions; print errors, targets and cost; exit code 1 if one misses",
    takes(
        "names", metavar="NAME", nargs="*",
        help="a case, a family of cases such as chain_n_links, or a case file; default: all",
    ),
)  # fmt: skip
def verify(args: Namespace) -> Answer:
    """Run verification cases. Raises PgraphError for an unknown name."""
    wanted = args.names or pgraph_models.case_names()
    chosen = [case for name in wanted for case in _cases(name)]
    began = time.perf_counter()
    rows = []
    for i, case in enumerate(chosen):
        tell(f"{case.name}  ({i + 1} of {len(chosen)}, {time.perf_counter() - began:.0f} s)")
        rows.append(facts(pg.verify(case)))
    tell("")
    missed = [row["case"] for row in rows if not row["ok"]]
    summary = f"{len(rows) - len(missed)} of {len(rows)} cases reach their targets"
    table = aligned((_cells(row) for row in rows), HEADER)
    problem = f"missed: {', '.join(missed)}" if missed else ""
    return Answer({"cases": rows}, f"{table}\n\n{summary}", problem)


def _cases(name: str) -> tuple[pg.Case, ...]:
    """Return the built-in cases with a name, or those in a file."""
    return pg.load_cases(name) if Path(name).suffix == ".json" else pgraph_models.cases(name)


def facts(verdict: pg.Verdict) -> dict[str, Any]:
    """Return one result as a dictionary with stable keys for scripts."""
    run, case = verdict.run, verdict.case
    return {
        "case": case.name,
        "compared": verdict.observable.name,
        "error": verdict.error,
        "target": verdict.observable.target,
        "reference_accuracy": case.accuracy,
        "seconds": verdict.seconds,
        "steps": run.counters["steps"] if run else 0,
        "method": run.header["method"] if run else "",
        "ok": verdict.ok,
        "message": run.message if run else "",
    }


def _cells(row: dict[str, Any]) -> tuple[Any, ...]:
    return (
        row["case"],
        row["compared"],
        f"{row['error']:.1e}",
        f"{row['target']:.0e}",
        f"{row['reference_accuracy']:.0e}",
        f"{row['seconds']:.2g}",
        row["steps"],
        row["method"] or "none",
        "ok" if row["ok"] else "MISSED",
    )

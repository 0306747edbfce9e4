"""`pgraph bench`: speed compared with the installed peers; only in a checkout."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from importlib import import_module
from pathlib import Path
from typing import Any

from pgraph_core.errors import InputError, Problem

from .terminal import Answer

HELP = "speed compared with MuJoCo, Pinocchio, Drake and Exudyn (in a checkout)"
ROOT = Path(__file__).parent.parent.parent


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--quick", action="store_true", help="fewer rounds, shorter chains")
    parser.add_argument("--markdown", action="store_true", help="the text of docs/benchmarks.md")
    parser.add_argument("--gate", action="store_true", help="exit code 1 if a ratio fell by 25 %%")
    parser.add_argument("--update-baseline", action="store_true", help="rewrite baseline.json")


def answer(args: Namespace) -> Answer:
    """Raises InputError if there is no folder `benchmarks`."""
    found: dict[str, Any] = part("suite").measured(quick=args.quick)
    report, gate = part("report"), part("gate")
    cpu, now, then = found["machine"]["cpu"], gate.ratios(found["rows"]), gate.load()
    wrong = gate.verdict(now, then, cpu) if args.gate else []
    if args.update_baseline:
        gate.save(gate.updated(then, cpu, now))
    text = report.markdown(found) if args.markdown else report.text(found)
    gated = {"gate": wrong} if args.gate else {}
    return Answer(found | gated, text, "\n".join(wrong))


def part(name: str) -> Any:
    """A module of the folder `benchmarks` of this checkout."""
    if not (ROOT / "benchmarks" / f"{name}.py").is_file():
        text = "the benchmarks are not installed with the package; run it in a checkout of Pgraph"
        raise InputError(Problem("pgraph bench", "", text))
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    return import_module(f"benchmarks.{name}")

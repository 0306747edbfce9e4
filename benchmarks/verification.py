"""All verification cases: `python -m benchmarks.verification` prints docs/verification.md."""

from __future__ import annotations

import sys

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.verify import facts
from pgraph_core.verification.cases import KINDS

from . import between
from .machine import machine

INTRODUCTION = """# Verification

`pgraph verify` computes known motions and compares them with their references;
`pgraph report --case NAME` shows error against run time for one of them. References are closed
forms, or come from methods of order 24 to 28 in 34 to 40 digits on independently derived equations.
Each file of `static_models/cases` describes its reference and how accurate it is.

Errors are relative to the larger of the quantity and its scale (default 1), the worst over all
frames and observables; points and forces count as vectors, rotations by their angle. A case file is
data: write one of your own and run `pgraph verify mine.json` (`examples/13_verify.py` makes one).
Kinds of observables: {kinds}.

Written by `python -m benchmarks.verification` on {cpu}; times are those of the stepping loop.

| case | compared | error | target | reference | time [s] | steps | method |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


BETWEEN = """
## Between and beyond the cases

Accelerations of a double pendulum over the mass of its tip, and of chains of point masses, against
50 digits; times of the first impacts of a ball dropped from 1 m, against the closed form. *May be*:
three times the accuracy of the case's reference, or of what one change in the last digit of the
given numbers does to the exact answer, computed. By `python -m benchmarks.between`.
"""


def line(row: dict[str, object]) -> str:
    cells = (
        row["case"],
        row["compared"],
        f"{row['error']:.1e}{'' if row['ok'] else ' (missed)'}",
        f"{row['target']:.0e}",
        f"{row['reference_accuracy']:.0e}",
        f"{row['seconds']:.2g}" if row["method"] else "",
        row["steps"] or "",
        row["method"] or "no run",
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    """Print the page; the name of each case goes to stderr."""
    kinds = ", ".join(f"`{kind}`" for kind in KINDS)
    print(INTRODUCTION.format(kinds=kinds, cpu=machine()["cpu"]))
    for name in pgraph_models.case_names():
        for case in pgraph_models.cases(name):
            print(case.name, file=sys.stderr)
            print(line(facts(pg.verify(case))), flush=True)
    print(BETWEEN)
    between.main()


if __name__ == "__main__":
    main()

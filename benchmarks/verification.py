"""All known motions computed: `python -m benchmarks.verification` prints docs/verification.md."""

from __future__ import annotations

import sys

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.verify import facts
from pgraph_core.verification.observables import KINDS

from .machine import machine

INTRODUCTION = """# Verification

`pgraph verify` computes motions that are known and compares them; `pgraph report --case NAME`
shows one against run time. References are closed forms, or come from methods of order 24 to 28 in
34 to 40 digits on equations derived apart from this code: each file of `static_models/cases` says
how, and how good.

Errors are relative to the larger of the quantity and its scale (1 where a case gives none), the
worst of all frames and observables; points and forces count as vectors, rotations by their angle.
A case file is data, and one of your own is `pgraph verify mine.json`: `examples/13_verify.py`
makes one. Kinds of observables: {kinds}.

Written by `python -m benchmarks.verification` on {cpu}; times are those of the steps.

| case | compared | error | target | reference | time [s] | steps | method |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


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
    """One case after the other, each told on stderr."""
    kinds = ", ".join(f"`{kind}`" for kind in KINDS)
    print(INTRODUCTION.format(kinds=kinds, cpu=machine()["cpu"]))
    for name in pgraph_models.case_names():
        for case in pgraph_models.cases(name):
            print(case.name, file=sys.stderr)
            print(line(facts(pg.verify(case))), flush=True)


if __name__ == "__main__":
    main()

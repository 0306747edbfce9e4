"""Pgraph beside MuJoCo and Pinocchio on the same models: `python -m benchmarks.peers`.

Results are compared before anything is timed. Needs the packages of the extra `oracles`.
"""

from __future__ import annotations

import argparse
import json

from .cases import all_cases
from .machine import machine
from .timing import Timed, measure


def seconds(value: float) -> str:
    """A time with a unit that suits it."""
    for unit, scale in (("us", 1e6), ("ms", 1e3)):
        if value * scale < 1000:
            return f"{value * scale:.3g} {unit}"
    return f"{value:.3g} s"


def line(timed: Timed, side: str) -> str:
    """One row of the table."""
    low, middle, high = timed.quartiles(side)
    cells = [timed.case.name, side, f"{seconds(middle)} ({seconds(low)} - {seconds(high)})"]
    if side == next(iter(timed.case.sides)):
        cells += [f"per {timed.case.unit}", timed.case.agreement]
    else:
        low, middle, high = timed.ratio(side)
        goal = f"; goal {timed.case.goal:g}" if timed.case.goal else ""
        cells += [f"{middle:.2f} ({low:.2f} - {high:.2f}) times ours{goal}", ""]
    return "| " + " | ".join(cells) + " |"


def text(results: list[Timed], about: dict[str, str | int]) -> str:
    """Markdown: the machine, then a table."""
    head = ", ".join(f"{key} {value}" for key, value in about.items())
    rows = [line(timed, side) for timed in results for side in timed.case.sides]
    columns = "| case | by | median (quartiles) | ratio in the same round | results differ by |"
    return "\n".join((head, "", columns, "|---|---|---|---|---|", *rows))


def data(results: list[Timed], about: dict[str, str | int]) -> dict[str, object]:
    """The same as one JSON object."""
    rows = [
        {
            "case": timed.case.name,
            "side": side,
            "unit": timed.case.unit,
            "seconds": timed.quartiles(side),
            "ratio": timed.ratio(side),
            "goal": timed.case.goal,
            "agreement": timed.case.agreement,
        }
        for timed in results
        for side in timed.case.sides
    ]
    return {"machine": about, "rows": rows}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument("--only", default="", help="only cases whose name holds this")
    arguments = parser.parse_args()
    cases = [case for case in all_cases() if arguments.only in case.name]
    results = measure(cases, arguments.rounds)
    about = machine()
    print(json.dumps(data(results, about)) if arguments.json else text(results, about))


if __name__ == "__main__":
    main()

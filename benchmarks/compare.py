"""Two checkouts in one run: `python -m benchmarks.compare OLD_TREE [ROW ...]`.

Each tree has a process of its own, which runs the rows of `compare_rows` by its own package. The
two take turns row by row, in an order that changes, so that both meet the same disturbances; the
minimum over the rounds is compared. Ratios are new over old: below 1 is faster.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .machine import ROOT
from .report import aligned, amount

WORKER = Path(__file__).with_name("compare_rows.py")
ROUNDS = 20
SLOWER = 1.03  # ratio above which a row is marked


class Tree:
    """A checkout, and the process that runs rows in it."""

    def __init__(self, place: Path, names: Sequence[str]):
        python = place / ".venv" / "bin" / "python"
        words = [str(python if python.exists() else sys.executable), str(WORKER), *names]
        paths = os.pathsep.join([str(place), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.process = subprocess.Popen(
            words,
            cwd=place,
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def answer(self) -> Any:
        """The next line of the process."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the process of a tree ended with code {self.process.wait()}")
        return json.loads(line)

    def seconds(self, name: str) -> float:
        """One sample of a row: seconds a call."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{name}\n")
        self.process.stdin.flush()
        return float(self.answer())

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def compared(old: Path, new: Path, names: Sequence[str], rounds: int) -> list[dict[str, Any]]:
    """{row, old, new, ratio, problem} of each row, in minimum seconds a call."""
    trees = {"old": Tree(old, names), "new": Tree(new, names)}
    try:
        ready = {side: tree.answer() for side, tree in trees.items()}  # {row: "" or the problem}
        rows = [{"row": name, "old": None, "new": None, "ratio": None} for name in ready["new"]]
        for row in rows:
            problems = (f"{side}: {ready[side][row['row']]}" for side in trees)
            row["problem"] = "; ".join(p for p in problems if not p.endswith(": "))
        least = {(row["row"], side): float("inf") for row in rows for side in trees}
        for k in range(rounds):
            for i, row in enumerate(rows):
                order = ("old", "new") if (i + k) % 2 else ("new", "old")
                for side in order if not row["problem"] else ():
                    key = row["row"], side
                    least[key] = min(least[key], trees[side].seconds(row["row"]))
            print(f"round {k + 1} of {rounds}", file=sys.stderr, flush=True)
    finally:
        for tree in trees.values():
            tree.close()
    for row in rows:
        if not row["problem"]:
            row |= {side: least[row["row"], side] for side in trees}
            row["ratio"] = row["new"] / row["old"]
    return rows


def lines(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The table for people."""
    found = [("row", "old", "new", "new / old", "")]
    for row in rows:
        if row["problem"]:
            found.append((row["row"], "-", "-", "-", row["problem"]))
            continue
        mark = "slower" if row["ratio"] > SLOWER else ""
        times = (amount(row[side], "call") for side in ("old", "new"))
        found.append((row["row"], *times, f"{row['ratio']:.3f}", mark))
    return found


def arguments() -> Namespace:
    """The command line."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("old", metavar="OLD_TREE", type=Path, help="a checkout of another commit")
    parser.add_argument("names", metavar="ROW", nargs="*", help="default: all rows")
    parser.add_argument("--new", type=Path, default=ROOT, metavar="TREE", help="default: this one")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--json", action="store_true", help="one JSON array instead of text")
    return parser.parse_args()


def main() -> None:
    """Print the table."""
    args = arguments()
    rows = compared(args.old.resolve(), args.new.resolve(), args.names, args.rounds)
    print(json.dumps(rows) if args.json else aligned(lines(rows)))


if __name__ == "__main__":
    main()

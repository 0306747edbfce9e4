"""`pgraph bench`: list the benchmarks, or run some of them and write their results."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pgraph_app.cli.terminal import aligned
from pgraph_core.errors import InputError, Problem, choices

from . import Benchmark, benchmarks, table
from .machine import machine
from .measure import Disagreement, Effort

INSTALL = "`pip install -e '.[oracles,gym,test]'` in the clone installs most of them."
RUN_THEM = "Run some with `pgraph bench NAME ...`, every one with `pgraph bench all`."
Reply = tuple[dict[str, Any], str, str]  # data, text, and problems or ""


def answer(args: Namespace, tell: Callable[[str], None]) -> Reply:
    """Run the named benchmarks, or list them all. Raises InputError for an unknown name."""
    known = benchmarks()
    if not args.names:
        return _listed(known)
    chosen = list(known) if args.names == ["all"] else args.names
    for name in chosen:
        if name not in known:
            text = f"no benchmark has this name; choose one of {choices(known, 40)}"
            raise InputError(Problem(f"benchmark '{name}'", "", text))
    if args.output and args.output.suffix not in table.WRITERS:
        text = f"must end in {choices(table.WRITERS)}, got '{args.output.name}'"
        raise InputError(Problem("--output", "", text))
    then = _earlier(args.against) if args.against else None
    peers = [peer for name in chosen for peer in known[name].peers]
    about, effort = machine(dict.fromkeys(peers)), Effort(args.quick)
    found: dict[str, Any] = {"machine": about, "quick": args.quick, "benchmarks": {}}
    notes, wrong = [], list[str]()
    for name in chosen:
        one = known[name]
        if one.lacks:
            notes.append(f"{name}: skipped, since {', '.join(one.lacks)} is not installed")
            continue
        if one.without:
            notes.append(f"{name}: not compared with {', '.join(one.without)}: not installed")
        rows = found["benchmarks"][name] = []
        try:
            for row in one.rows(effort):
                rows.append(row)
                tell(f"{name}: {row.get('case', len(rows))}")
        except Disagreement as problem:
            wrong.append(f"{name}: {problem}")
        if args.output:  # after each, so that an interrupted run is not lost
            _write(args.output, table.WRITERS[args.output.suffix](found))
    tell("")
    wrong += table.fallen(found, then) if then else []
    text = "\n\n".join((table.text(found), *filter(None, ["\n".join(notes)])))
    return {**found, "notes": notes, "problems": wrong}, text, "\n".join(wrong)


def _listed(known: dict[str, Benchmark]) -> Reply:
    """List the benchmarks, their peers and approximate durations."""
    rows = [
        (one.name, f"{one.minutes:g} min", ", ".join(one.peers), one.what) for one in known.values()
    ]
    shown = aligned(rows, ("name", "takes", "peers", "measures"))
    data = [{"name": o.name, "minutes": o.minutes, "peers": o.peers, "what": o.what}
            for o in known.values()]  # fmt: skip
    lacking = sorted({x for one in known.values() for x in (*one.without, *one.lacks)})
    notes = [f"Not installed: {', '.join(lacking)}. {INSTALL}"] if lacking else []
    return {"benchmarks": data}, "\n\n".join((shown, RUN_THEM, *notes)), ""


def _earlier(path: Path) -> dict[str, Any]:
    """Load an earlier run. Raises InputError."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(found["machine"]["cpu"], str) and isinstance(found["benchmarks"], dict):
            return found
    except (OSError, ValueError, KeyError, TypeError):
        pass
    text = "must be a .json file that `pgraph bench NAME -o FILE` wrote"
    raise InputError(Problem(f"--against '{path}'", "", text))


def _write(path: Path, text: str) -> None:
    """Raises InputError."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(Problem(f"--output '{path}'", "", str(error.strerror))) from None

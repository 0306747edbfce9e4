"""Commands that check Pgraph itself: `pgraph verify`, `hunt` and `bench`."""

from __future__ import annotations

import json
import sys
import time
from argparse import ArgumentParser, Namespace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pgraph_core as pg
import pgraph_models
from pgraph_core.errors import InputError, Problem, choices

from .terminal import Answer, Command, aligned, count, seed

if TYPE_CHECKING:
    from pgraph_core.verification.hunt import Find

HEADER = (
    "case", "compared", "error", "target", "reference", "time [s]", "steps", "method", "verdict"
)  # fmt: skip
ROOT = Path(__file__).parent.parent.parent


def _tell(text: str) -> None:
    """Progress on a terminal, over the last line; nothing in a pipe."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


# -- verify ----------------------------------------------------------------------------------------


def verify_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "names", metavar="NAME", nargs="*",
        help="a case, a family of cases such as chain_n_links, or a case file; default: all",
    )  # fmt: skip


def verify(args: Namespace) -> Answer:
    """Raises PgraphError for an unknown name."""
    wanted = args.names or pgraph_models.case_names()
    chosen = [case for name in wanted for case in _cases(name)]
    began = time.perf_counter()
    rows = []
    for i, case in enumerate(chosen):
        _tell(f"{case.name}  ({i + 1} of {len(chosen)}, {time.perf_counter() - began:.0f} s)")
        rows.append(facts(pg.verify(case)))
    _tell("")
    missed = [row["case"] for row in rows if not row["ok"]]
    summary = f"{len(rows) - len(missed)} of {len(rows)} cases reach their targets"
    table = aligned((_cells(row) for row in rows), HEADER)
    problem = f"missed: {', '.join(missed)}" if missed else ""
    return Answer({"cases": rows}, f"{table}\n\n{summary}", problem)


def _cases(name: str) -> tuple[pg.Case, ...]:
    """The built-in cases of a name, or those in a file."""
    return pg.load_cases(name) if Path(name).suffix == ".json" else pgraph_models.cases(name)


def facts(verdict: pg.Verdict) -> dict[str, Any]:
    """One result, under names that scripts can rely on."""
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


# -- hunt ------------------------------------------------------------------------------------------


def hunt_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--scenes", type=count, default=2000, help="how many (default: 2000)")
    parser.add_argument("--seed", type=seed, default=0, help="of the random numbers (default: 0)")
    parser.add_argument("--first", type=seed, default=0, help="number of the first (default: 0)")


def hunt(args: Namespace) -> Answer:
    from pgraph_core.verification import hunt as scenes  # other commands need no kernels

    began = time.perf_counter()
    given = args.scenes, args.seed, lambda number: _tell(f"scene {number + 1}"), args.first
    finds = list(scenes.hunt(*given))
    seconds = time.perf_counter() - began
    silent = [find for find in finds if find.verdict == "silent"]
    data: dict[str, Any] = {
        "scenes": args.scenes,
        "seed": args.seed,
        "first": args.first,
        "seconds": seconds,
        "runs": [facts_of_scene(find) for find in finds],
    }
    problem = f"{len(silent)} runs are wrong and silent" if silent else ""
    return Answer(data, scenes.told(finds, seconds), problem)


def facts_of_scene(find: Find) -> dict[str, Any]:
    """One run, under names that scripts can rely on."""
    return {
        "family": find.scene.family,
        "scene": find.scene.what,
        "t_end": find.scene.t_end,
        "setting": find.setting,
        "verdict": find.verdict,
        "error": find.error,
        "estimate": find.estimate,
        "says": find.says,
        "floor": find.scene.floor,
    }


# -- bench -----------------------------------------------------------------------------------------


def bench_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "names", metavar="NAME", nargs="*", help="benchmarks, or `all`; without: list them"
    )
    parser.add_argument("--quick", action="store_true", help="the smallest sizes: rough figures")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=".json, .csv, .md, .txt")
    parser.add_argument(
        "--against", type=Path, metavar="FILE",
        help="a .json of an earlier run; exit code 1 if a ratio to a peer fell by 25 %%",
    )  # fmt: skip


def bench(args: Namespace) -> Answer:
    """Raises InputError where this is no clone, or for an unknown name."""
    folder, table, measure, machine = (part(x) for x in ("", "table", "measure", "machine"))
    known = folder.benchmarks()
    if not args.names:
        return _listed(known)
    chosen = list(known) if args.names == ["all"] else args.names
    for name in chosen:
        if name not in known:
            text = f"no benchmark has this name; choose one of {choices(known, 40)}"
            raise InputError(Problem(f"benchmark '{name}'", "", text))
    if args.output and args.output.suffix not in table.WRITERS:
        text = f"must end in {choices(table.WRITERS)}; given '{args.output.name}'"
        raise InputError(Problem("--output", "", text))
    then = _earlier(args.against) if args.against else None
    peers = [peer for name in chosen for peer in known[name].peers]
    about, effort = machine.machine(dict.fromkeys(peers)), measure.Effort(args.quick)
    found: dict[str, Any] = {"machine": about, "quick": args.quick, "benchmarks": {}}
    notes = []
    for name in chosen:
        one = known[name]
        if one.lacks:
            notes.append(f"{name}: skipped, since {', '.join(one.lacks)} is not installed")
            continue
        if one.without:
            notes.append(f"{name}: not compared with {', '.join(one.without)}: not installed")
        rows = found["benchmarks"][name] = []
        for row in one.rows(effort):
            rows.append(row)
            _tell(f"{name}: {row.get('case', len(rows))}")
        if args.output:  # after each, so that an interrupted run is not lost
            args.output.write_text(table.WRITERS[args.output.suffix](found), encoding="utf-8")
    _tell("")
    wrong = table.fallen(found, then) if then else []
    text = "\n\n".join((table.text(found), *filter(None, ["\n".join(notes)])))
    return Answer({**found, "notes": notes, "fallen": wrong}, text, "\n".join(wrong))


def _listed(known: dict[str, Any]) -> Answer:
    """The benchmarks, their peers and about how long they take."""
    rows = [
        (one.name, f"{one.minutes:g} min", ", ".join(one.peers), one.what) for one in known.values()
    ]
    table = aligned(rows, ("name", "takes", "peers", "measures"))
    data = [{"name": o.name, "minutes": o.minutes, "peers": o.peers, "what": o.what}
            for o in known.values()]  # fmt: skip
    lacking = sorted({x for one in known.values() for x in (*one.without, *one.lacks)})
    notes = [f"Not installed: {', '.join(lacking)}."] if lacking else []
    return Answer({"benchmarks": data}, "\n\n".join((table, RUN_THEM, *notes)))


RUN_THEM = "Run some with `pgraph bench NAME ...`, every one with `pgraph bench all`."


def _earlier(path: Path) -> dict[str, Any]:
    """An earlier run. Raises InputError."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        found["machine"]["cpu"], found["benchmarks"].items()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        text = "must be a .json file that `pgraph bench NAME -o FILE` wrote"
        raise InputError(Problem(f"--against '{path}'", "", text)) from None
    return found


def part(name: str) -> Any:
    """The folder `benchmarks` of this clone, or a module of it."""
    if not (ROOT / "benchmarks" / "__init__.py").is_file():
        text = "the package is installed without the benchmarks; run it in a clone of Pgraph"
        raise InputError(Problem("pgraph bench", "", text))
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    return import_module(f"benchmarks.{name}".removesuffix("."))


COMMANDS = (
    Command(
        "verify",
        "compute known motions; print errors, targets and cost; exit code 1 if one misses",
        verify_arguments,
        verify,
        simulates=True,
    ),
    Command(
        "hunt",
        "run random scenes; print the runs that are wrong and do not say so; exit code 1 if any",
        hunt_arguments,
        hunt,
        simulates=True,
    ),
    Command(
        "bench",
        "run benchmarks, most of them against other programs (in a clone)",
        bench_arguments,
        bench,
    ),
)

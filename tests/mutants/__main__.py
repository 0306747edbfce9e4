"""`python -m tests.mutants`: measure how many of 200 small faults the tests catch.

One copy of the repository contains every mutant behind a switch, so its kernels are compiled once.
A first run of all tests records the mutants that each test reaches. Then, for each mutant, the
tests that reach it run until one fails. See `docs/developer.md`.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from pathlib import Path

from .sites import AREAS, Site, draw, found_again, rewritten

HERE = Path(__file__).resolve().parent
NOT_RUN = ("browser", "timed", "nightly")  # markers, where the repository has them
# Tests of compilers, benchmarks and the repository.
LEFT_OUT = "core/test_compilation test_bench test_site test_packages test_repository"


def main() -> None:
    """Parse the command line, make the copy, trace it and run the mutants."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    for name, kind, default, text in (
        ("tree", Path, HERE.parent.parent, "repository to test (default: this one)"),
        ("at", Path, None, "working folder (default: build/mutants)"),
        ("seed", int, 32, "seed of the draw"),
        ("count", int, 200, "number of mutants"),
        ("jobs", int, 1, "parallel processes"),
        ("budget", float, 20.0, "seconds of recorded test time per mutant"),
        ("again", Path, None, "earlier results: run the same mutants and compare"),
    ):
        parser.add_argument(f"--{name}", type=kind, default=default, help=text)
    parser.add_argument("--trace", action="store_true", help="only trace the tests again")
    parser.add_argument("--list", action="store_true", help="only list the mutants")
    parser.add_argument("--only", type=int, nargs="+", metavar="K", help="run only these mutants")
    given = parser.parse_args()
    tree = given.tree.resolve()
    again = found_again(tree, json.loads(given.again.read_text())) if given.again else []
    known = [old for old, _ in again]
    sites = [site for _, site in again] or draw(tree, given.seed, given.count)
    if given.list:
        print(*(f"{k} {s.key}  {s.description}" for k, s in enumerate(sites)), sep="\n")
        return
    at = (given.at or tree / "build" / "mutants").resolve()
    copied, trace = at / "tree", at / "trace.jsonl"
    if given.trace or not trace.exists():
        make_copy(tree, copied, sites)
        print("compile the kernels", flush=True)
        python(at, "-m", "pgraph_core.engine", stdout=subprocess.DEVNULL, check=True)
        for path in at.glob("trace*"):
            path.unlink()
        workers = ("-n", str(given.jobs), "--dist", "loadfile") if given.jobs > 1 else ()
        pytest(at, "trace", *workers)
        trace.write_text("".join(p.read_text() for p in sorted(at.glob("trace.*.jsonl"))))
    if given.trace:
        return
    wanted = given.only or [*range(len(sites))]
    task = {"mutants": wanted, "jobs": given.jobs, "budget": given.budget}
    (at / "wanted.json").write_text(json.dumps(task))
    pytest(at, "run")
    found = json.loads((at / "found.json").read_text())
    fields = ("area", "file", "line", "column", "kind", "description")
    results = [
        {"k": k, **{field: getattr(site, field) for field in fields}, **found[str(k)]}
        for k, site in enumerate(sites)
        if str(k) in found
    ]
    (at / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    print(table(results))
    for old, new in zip(known, results) if not given.only else ():
        if old["result"] != new["result"]:
            print(f"{new['k']} {new['file']}:{new['line']}: {old['result']}, now {new['result']}")


def make_copy(tree: Path, copied: Path, sites: list[Site]) -> None:
    """Write the tree's files with all mutants into `copied`."""
    listed = f"git -C {shlex.quote(str(tree))} ls-files -z --cached --others --exclude-standard"
    names = subprocess.run(shlex.split(listed), check=True, capture_output=True, text=True).stdout
    wanted = {name for name in names.split("\0") if name and os.path.lexists(tree / name)}
    for path in sorted(copied.rglob("*"), reverse=True):
        kept = path.relative_to(copied).as_posix() in wanted
        if path.is_file() and not kept:
            path.unlink()
    inside = defaultdict(list)
    for k, site in enumerate(sites):
        inside[site.file].append((k, site))
    for name in wanted:
        path = copied / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        if name in inside:
            text = rewritten((tree / name).read_text(encoding="utf-8"), inside[name])
            path.write_text(text, encoding="utf-8")
        else:
            shutil.copy2(tree / name, path, follow_symlinks=False)


def python(at: Path, *args: str, mode: str = "", **options) -> None:
    """Run Python with the packages of the copy."""
    paths = (at / "tree", at / "tree" / "typings", HERE)  # `typings` links packages to folders
    here = {
        "PYTHONPATH": os.pathsep.join(map(str, paths)),
        "PGRAPH_MUTANTS": f"{mode}:{at}",
        "PGRAPH_CACHE": str(at / "cache"),
    }
    if mode == "trace":
        here["PGRAPH_MUTANTS_TRACED"] = str(at / "traced")
    environment = {**os.environ, **here, "PYTHONHASHSEED": "0"}
    subprocess.run((sys.executable, *args), cwd=at / "tree", env=environment, **options)


def pytest(at: Path, mode: str, *more: str) -> None:
    """Run the tests of the copy with the plugin in the given mode."""
    settings = tomllib.loads((at / "tree" / "pyproject.toml").read_text())
    markers = settings["tool"]["pytest"]["ini_options"]["markers"]
    not_run = " or ".join(name for name in NOT_RUN if any(m.startswith(name) for m in markers))
    plain = shlex.split("-p mutant_plugin -p no:cacheprovider -q --no-header -s --tb=no")
    left_out = (f"--ignore=tests/{name}.py" for name in LEFT_OUT.split())
    python(at, "-m", "pytest", *plain, "-m", f"not ({not_run})", *left_out, *more, mode=mode)


def table(results: list[dict]) -> str:
    """Return a table of the results by area."""
    counts = {area: Counter(r["result"] for r in results if r["area"] == area) for area in AREAS}
    kinds = ("caught", "survived", "not reached")
    lines = [f"{'area':<12} {'mutants':>8}" + "".join(f"{kind:>13}" for kind in kinds)]
    for area, n in (*counts.items(), ("all", sum(counts.values(), Counter()))):
        lines.append(f"{area:<12} {sum(n.values()):>8}" + "".join(f"{n[k]:>13}" for k in kinds))
    return "\n".join(lines)


if __name__ == "__main__":
    main()

"""Error against run time of whole calls, compared with MuJoCo, Pinocchio with SciPy, Exudyn, and
SUNDIALS on our equations, on eight motions.

`python -m benchmarks.work_precision` prints the tables of docs/report.md; `--page FILE` writes the
diagrams as one page, `--svg FOLDER` each of them; names after them pick some of the motions.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.page import Section, duration, page

from .methods import motions

ROUNDS, LONGEST = 5, 4.0
METHODS = ("rk4", "dopri5", "dop853")  # where the motion is not stiff
PEERS = ("mujoco", "pinocchio", "exudyn", "sundials")
LONG = 5e-3  # [s] of a peer from which it should be beaten by FAR
NEAR, FAR = 3.0, 5.0  # times


def motion(name: str, **options: Any) -> pg.Study:
    """One of `benchmarks.methods`."""
    found = motions()[name]
    q, v = (np.array(x, dtype=float) for x in (found.q, found.v))
    return measured(pg.Mechanism(found.model), q, v, t_end=found.t_end, **options)


def stance(**options: Any) -> pg.Study:
    """The quadruped's push on four feet."""
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path("quadruped")))
    return measured(mech, scenario="stance", frames=126, **options)  # its tables' knots


def built_in(name: str, t_end: float, scenario: str | None = None, **options: Any) -> pg.Study:
    """One of the built-in models."""
    mech = pg.Mechanism(pg.Model.load(pgraph_models.path(name)))
    return measured(mech, scenario=scenario, t_end=t_end, **options)


def measured(*mech_and_state: Any, **options: Any) -> pg.Study:
    """Compared with the peers in processor time, so that the machine need not be quiet."""
    given = {"methods": METHODS, "peers": PEERS, "target": 1e-6, "longest": LONGEST}
    return pg.work_precision(*mech_and_state, **{**given, "clock": "processor", **options})


SCENES: dict[str, Callable[..., pg.Study]] = {
    "double pendulum": lambda **options: motion("double pendulum", **options),
    "heavy top": lambda **options: motion("top at 150 rad/s", **options),
    "quadruped stance": stance,
    "chain of 100": lambda **options: motion("chain of 100", **options),
    "spring of 1e8 N/m": lambda **options: motion(
        "spring of 1e8 N/m", methods=("radau5", "ros2", "generalised_alpha"), **options
    ),
    "four-bar": lambda **options: built_in("four_bar", 1.0, "turn", **options),
    "tennis racket": lambda **options: built_in("tennis_racket", 2.0, **options),
    "tree of figure 1": lambda **options: built_in("fig1_tree", 1.0, **options),
}


def table(name: str, study: pg.Study) -> str:
    """Times at equal error as Markdown."""
    found = study.peer_table()
    if not found:
        return "\n".join(
            (f"### {name}", "", "No peer takes it, or reaches an error.", *study.notes)
        )
    header, *rows = found
    lines = (header, ["---"] * len(header), *rows)
    body = (f"| {' | '.join(cells).replace(' x)', ' ×)')} |" for cells in lines)
    return "\n".join((f"### {name}", "", *body, *study.notes))


def summary(found: dict[str, pg.Study]) -> str:
    """How many cells are at least as fast, 3 times, 5 times where a peer takes long; the rest."""
    rows = [(name, row) for name, study in found.items() for row in study.against_peers()]
    ratios = np.array([row["ratio"] for _, row in rows])
    long = np.array([row["peer_seconds"] > LONG for _, row in rows])
    near, far = (ratios >= NEAR).sum(), (ratios[long] >= FAR).sum()
    lines = [
        f"{(ratios >= 1).sum()} of {len(rows)} cells at least as fast, {near} at least {NEAR:g} "
        f"times; {far} of the {long.sum()} in which the peer takes more than {1e3 * LONG:g} ms at "
        f"least {FAR:g} times. Below that:", "",
        "| motion | error | peer | peer's time | ours | ratio | below |", "| --- " * 7 + "|",
    ]  # fmt: skip
    for name, row in rows:
        wanted = FAR if row["peer_seconds"] > LONG else NEAR
        if row["ratio"] < wanted:
            below = next(x for x in (1.0, NEAR, FAR) if row["ratio"] < x)
            lines.append(
                f"| {name} | {row['error']:.0e} | {row['peer']} | "
                f"{duration(row['peer_seconds'])} | {row['ours']}, {duration(row['seconds'])} | "
                f"{row['ratio']:.2f} | {below:g} × |"
            )
    return "\n".join(lines)


def arguments() -> Namespace:
    """The command line."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--page", metavar="FILE")
    parser.add_argument("--svg", metavar="FOLDER", type=Path)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    return parser.parse_args()


def main() -> None:
    """Print the tables."""
    args = arguments()
    parts: list[Section] = []
    machine, studies = "", {}
    for name in args.names or SCENES:
        study = studies[name] = SCENES[name](rounds=args.rounds)
        machine = f"{study.machine['cpu']}, one thread, processor time, minima of {args.rounds}"
        print(f"{table(name, study)}\n", flush=True)
        least = min((row["ratio"] for row in study.against_peers()), default=float("nan"))
        print(f"{name}: at least {least:.2g} times faster than each peer", file=sys.stderr)
        parts += [Section(f"{name}: {part.title}", part.body) for part in study.sections()]
        if args.svg:
            (args.svg / f"{name.replace(' ', '_')}.svg").write_text(study.figure())
    print(summary(studies))
    if args.page:
        Path(args.page).write_text(page("Error against run time", parts, [machine]))


if __name__ == "__main__":
    main()

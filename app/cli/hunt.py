"""`pgraph hunt`: random scenes, judged by what is known of them."""

from __future__ import annotations

import sys
import time
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

import pgraph_core as pg

from .terminal import Answer

if TYPE_CHECKING:
    from pgraph_core.verification.hunt import Find

HELP = "run random scenes; print the runs that are wrong and do not say so; exit code 1 if any"


def arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--scenes", type=int, default=2000, help="how many (default: 2000)")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers (default: 0)")


def answer(args: Namespace) -> Answer:
    """Raises InputError for a number of scenes below 1."""
    from pgraph_core.verification.hunt import hunt, told  # other commands need no kernels

    if args.scenes < 1 or args.seed < 0:
        text = f"needs a number >= 1, and a seed >= 0; given {args.scenes} and {args.seed}"
        raise pg.InputError(pg.errors.Problem("pgraph hunt", "--scenes", text))
    began = time.perf_counter()
    tell = _line if sys.stderr.isatty() else None
    finds = list(hunt(args.scenes, args.seed, tell))
    seconds = time.perf_counter() - began
    silent = [find for find in finds if find.verdict == "silent"]
    data: dict[str, Any] = {
        "scenes": args.scenes,
        "seed": args.seed,
        "seconds": seconds,
        "runs": [facts(find) for find in finds],
    }
    problem = f"{len(silent)} runs are wrong and silent" if silent else ""
    return Answer(data, told(finds, seconds), problem)


def facts(find: Find) -> dict[str, Any]:
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


def _line(number: int) -> None:
    """Progress on a terminal, over the last line."""
    print(f"\r\033[Kscene {number + 1}", end="", file=sys.stderr, flush=True)

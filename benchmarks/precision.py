"""Errors of forward dynamics, ours and the peers', against 50 digits.

`python -m benchmarks.precision` prints a table; `--write` rewrites docs/precision.md (a minute),
`--quick` leaves out chains of 1000.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

import pgraph_core as pg
from pgraph_peers import drake as in_drake
from pgraph_peers import mujoco as in_mujoco
from pgraph_peers import pinocchio as in_pinocchio
from pgraph_peers.rows import rows_of

from . import fifty_digits
from .machine import ROOT, has, machine
from .precision_cases import LONG, SHORT, turned
from .random_models import State
from .report import piped
from .scenes import STEP, Scene

SEEDS = 3  # of chains below 1000
CUBIC = 300  # bodies: beyond, Pinocchio's data on a chain does not fit into memory
SIDES = {"pgraph": "Pgraph", "mujoco": "MuJoCo", "pin": "Pinocchio", "drake": "Drake"}
NAMED = ("pgraph-dynamics", *SIDES)
DOCUMENT = ROOT / "docs" / "precision.md"
TEXT = """# Precision compared with MuJoCo, Pinocchio and Drake

Made by `python -m benchmarks.precision --write` with {machine}.

Each number is the largest error of an acceleration, relative to the largest acceleration, against
forward dynamics in 50 digits (`benchmarks/fifty_digits.py`, confirmed by inverse dynamics to
1e-30). It is the worst of {seeds} random chains, or of one chain with 1000 bodies. Every chain has
hinges, velocities, torques and gravity.

## Rotated frames

The whole chain and every body frame are rotated at random, so that no program gains from axes that
lie along a rod. Rotations that are rounded in a program's own input format count as its error.
*Bound* is the bound of our test: 1e-13, or 10 eps times the mass ratio if that is larger. Two cases
have a number that acts like a mass ratio: 1e8 for an arm of 1e4 m between other bodies, and n³/3
for a straight chain, whose inertia against bending out of its plane exceeds that of one rod by that
factor. `tests/core/test_precision.py` holds the bounds.

{turned}

Pinocchio keeps arrays that grow with the cube of a chain's length: 1000 bodies do not fit into
memory.

## Original frames

The same chains in the frames in which they are written. Those of the straight chains lie along the
world's axes and the rods, so that no components mix.

{built}
"""


def accelerations(state: State) -> Iterator[tuple[str, np.ndarray]]:
    """v' by every installed engine, in our coordinates."""
    place = Scene("", state, rows_of(state.model, state.topology))
    n = state.topology.nb
    yield "pgraph", pg.Mechanism(state.model).forward_dynamics(state.q, state.v, state.tau)
    if has("mujoco"):
        import mujoco

        model, data, T = in_mujoco.loaded(place, STEP)
        mujoco.mj_forward(model, data)
        yield "mujoco", T.T @ data.qacc
    if has("pin") and n <= CUBIC:
        yield "pin", in_pinocchio.forward_dynamics(place)[1]
    if has("drake"):
        yield "drake", in_drake.forward_dynamics(place)[1]


def errors(state: State) -> dict[str, float]:
    """Largest error relative to the largest acceleration, by side."""
    expected = fifty_digits.forward_dynamics(state.model, state.q, state.v, state.tau)
    scale = max(abs(expected))
    return {side: float(max(abs(found - expected)) / scale) for side, found in accelerations(state)}


def row(name: str, bound: float, states: list[State]) -> tuple[str, ...]:
    """A line of the table: the worst of the states."""
    each = [errors(state) for state in states]
    worst = {side: max(error[side] for error in each) for side in each[0]}
    cells = (f"{worst[side]:.0e}" if side in worst else "-" for side in SIDES)
    return name, f"{bound:.0e}", *cells


def tables(*, quick: bool) -> tuple[str, str]:
    """The tables of rotated and of original frames."""
    listed = [(name, case, SEEDS) for name, case in SHORT.items()]
    listed += [] if quick else [(name, case, 1) for name, case in LONG.items()]
    askew, built = [], []
    for name, case, seeds in listed:
        states = [case.state(seed) for seed in range(seeds)]
        askew.append(row(name, case.turned_bound, [turned(s, i) for i, s in enumerate(states)]))
        built.append(row(name, case.bound, states))
    head = ("chain", "bound", *SIDES.values())
    return piped(head, askew), piped(head, built)


def main(*words: str) -> None:
    """Print the tables, or write the document."""
    askew, built = tables(quick="--quick" in words)
    print(f"rotated frames\n\n{askew}\n\noriginal frames\n\n{built}")
    if "--write" in words:
        versions = ", ".join(f"{key} {x}" for key, x in machine().items() if key in NAMED)
        text = TEXT.format(machine=versions, seeds=SEEDS, turned=askew, built=built)
        DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

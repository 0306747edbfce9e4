"""Results of the suite for people: a table in the terminal, and docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pgraph_core.study import page

Found = Mapping[str, Any]
COLUMNS = ("case", "by", "median", "quartiles", "ratio", "quartiles", "goal")
INTRODUCTION = """# Speed compared with MuJoCo, Pinocchio, Drake and Exudyn

Made by `pgraph bench --markdown`, which needs the packages of the extra `oracles` (and `drake` and
`exudyn` for their rows). All engines run in one process, warm, in rounds of a random order; times
are medians with quartiles over the rounds, and a ratio is the peer's time over ours in the same
round. Peers are built from the same model, and results are compared before anything is timed (last
table): nothing is timed that does not agree.

* A *step* is the time in which `simulate` builds and steps a run, without our error estimate, which
  has no counterpart; a *whole call* is everything, from the arguments to the result; with the
  estimate it includes two coarser runs, and a finer one where the motion is *chaotic*; a *batch* is
  `reset` and `step` of a `BatchStepper`, from equal initial states.
* *Stance* has four feet on the ground, twelve rows. A *whole run* counts an acceleration in the
  RK4 run of the scenario, projection and energy ledger included, against one call of a peer.
  `pin.constraintDynamics` runs at the coarsest settings that reach our accuracy (four iterations);
  MuJoCo's feet are soft, and its solver starts from its last solution of this state.
* *pinocchio::aba* is a loop in C++ (`benchmarks/pinocchio_loop.cpp`), compiled with -O3 for this
  machine if g++ and the headers of Eigen (`pip install cmeel-eigen`) are installed.
* *What a scene lacks* compares our kernels to kernels made from the same source without what the
  scene does not need: branches on other kinds of motion, armature, joint forces, constraints. Its
  steps also lack what a run does for every scene: an energy ledger, counters, pauses.
* *Columns to Mechanism* starts at arrays in memory, as the peers do, names included.
* *Model to Mechanism* starts at a validated model, a new one every time; making that is part of
  *text to Mechanism*, which reads and validates the text of a file, compared with MuJoCo's XML.
* Medians differ more between processes than the quartiles within one: in three runs in a row the
  native loop gave ratios of 2.88, 2.43 and 2.76, the semi-implicit step 2.40, 2.57 and 2.58, the
  RK4 step 2.53, 2.59 and 2.50. Two threads need both cores, so other programs slow them down.
* *Lanes* are the doubles in a vector register: 8 with AVX-512, 4 with AVX2. A batch fills them:
  with eight, commit 3fdb872 was 12.5 and 10.5 times as fast as the rollout on one and two threads.
  `benchmarks.compare` of commit 6db6ff4 and this one, in one run: 0.96 to 1.07 of its times.
* *Parent changed* edits one mechanism into the next (`mech.edit`), which is then ready; also with
  Pgraph, jdof and the mass matrix, and through `model.edit`. The peers cannot move a body to
  another parent in a built model: they rebuild model and data from a prepared spec or rows.
* *Mass changed* keeps the topology; MuJoCo writes into its model and calls `mj_setConst`.

`python -m benchmarks.compare OLD_TREE` compares two checkouts of Pgraph instead: both take turns in
one run, and the minimum times of whole calls and kernels are printed with their ratios.
"""


def text(found: Found) -> str:
    """The terminal's table."""
    parts = [f"measured on {machine(found)}", aligned([COLUMNS, *lines(found)])]
    parts.append("\n".join(sentences(found)))
    return "\n\n".join(parts)


def markdown(found: Found) -> str:
    """docs/benchmarks.md."""
    goals = list(goal_lines(found))
    agreement = [(row["case"], row["agreement"]) for row in found["rows"] if row["agreement"]]
    return "\n\n".join(
        (
            INTRODUCTION.rstrip(),
            f"Measured on {machine(found)}.",
            "## Goals",
            piped(("case", "peer", "goal", "measured", ""), goals),
            "\n".join(f"* {sentence}" for sentence in sentences(found)),
            "## All of it",
            piped(COLUMNS, lines(found)),
            "## How far results differ",
            "Largest difference relative to the largest number, or 1.",
            piped(("case", "by"), agreement),
        )
    )


def machine(found: Found) -> str:
    """One line."""
    about = dict(found["machine"])
    return ", ".join([about.pop("cpu"), *(f"{key} {value}" for key, value in about.items())])


def lines(found: Found) -> Iterator[tuple[str, ...]]:
    """One line for each side; the case is named once."""
    last = ""
    for row in found["rows"]:
        low, middle, high = (amount(x, row["unit"]) for x in row["seconds"])
        ratio = row["ratio"] or ()
        shown = (f"{ratio[1]:.3g}", f"{ratio[0]:.3g} - {ratio[2]:.3g}") if ratio else ("", "")
        goal = "" if row["goal"] is None else f"{row['goal']:g}"
        goal = goal if row["at_most"] is None else f"<= {row['at_most']:g}"
        case = "" if row["case"] == last else row["case"]
        last = row["case"]
        yield case, row["side"], middle, f"{low} - {high}", *shown, goal


def amount(seconds: float, unit: str) -> str:
    """A time with its unit; instance-steps as a rate."""
    if unit == "instance-step":
        return f"{1e-6 / seconds:.3g} M/s"
    for name, scale in (("us", 1e6), ("ms", 1e3)):
        if seconds * scale < 1000:
            return f"{seconds * scale:.3g} {name}"
    return f"{seconds:.3g} s"


def goal_lines(found: Found) -> Iterator[tuple[str, ...]]:
    """Every goal, its measured value, and whether it is met."""
    for row in found["rows"]:
        if row["goal"] is not None and row["ratio"]:
            ratio = row["ratio"][1]
            met = "met" if ratio >= row["goal"] else "not met"
            yield row["case"], row["side"], f">= {row['goal']:g}", f"{ratio:.3g}", met
        if row["at_most"] is not None:
            ratio = row["ratio"][1]
            met = "met" if ratio <= row["at_most"] else "not met"
            yield row["case"], row["side"], f"<= {row['at_most']:g}", f"{ratio:.3f}", met
    scaling = found["scaling"]
    exponent = scaling["exponent"][1]
    met = "met" if exponent <= scaling["goal"] else "not met"
    case = "forward dynamics, chains: exponent of n"
    yield case, "", f"<= {scaling['goal']:g}", f"{exponent:.3f}", met


def sentences(found: Found) -> Iterator[str]:
    """Facts that are not in the table."""
    low, middle, high = found["scaling"]["exponent"]
    goal = found["scaling"]["goal"]
    yield f"scaling on chains: time grows as n^{middle:.3f} ({low:.3f} - {high:.3f}); goal {goal:g}"
    yield from found["notes"]
    if found["absent"]:
        yield f"not installed, so not compared: {', '.join(found['absent'])}"
    goals = list(goal_lines(found))
    missed = [f"{case}, {side} ({value})" for case, side, _, value, met in goals if met != "met"]
    yield f"goals met: {len(goals) - len(missed)} of {len(goals)} that were measured"
    if missed:
        yield f"not met: {'; '.join(missed)}"
    for sentence in found["not_measured"]:
        yield f"not measured: {sentence}"


def aligned(rows: Iterable[Sequence[str]]) -> str:
    """Columns of equal width."""
    cells = list(rows)
    return "\n".join(page.aligned(cells, [True] * len(cells[0])))


def piped(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(
        "| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)
    )

"""What stability maps and reports answer, tried.

`python -m benchmarks.answers [WORD ...]` prints the table of docs/stability.md, or the rows whose
subjects hold one of the words.

Subjects are the built-in models, as they are and in each scenario, ten random trees, and one scene
of each family of the hunt: contacts, limits, tables, loops, drives. The one sentence of an answer
names a method and a setting; a run by these is compared with another method's, at a tolerance of
1e-11 where that takes the scene.
"""

from __future__ import annotations

import re
import sys
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

import pgraph_core as pg
import pgraph_models
from pgraph_core.study.axes import AXES
from pgraph_core.study.measures import differences, joint_errors, observer, reach, rms
from pgraph_core.study.stability import in_scenario
from pgraph_core.study.task import Task
from pgraph_core.verification.hunt import FAMILIES, scenes

from .machine import machine
from .random_models import random_case

FRAMES = 21
RANDOM = 10
PARTS = (0.1, 1e-2, 1e-3)  # of a motion whose length is its own: steps
HOLDS, TOLD, WRONG = "holds", "why not", "WRONG"


class Subject(NamedTuple):
    """A model that is asked about, and how long its motion is."""

    name: str
    model: pg.Model
    scenario: str | None
    t_end: float | None  # [s]; None: that of the scenario, or 1 s


class Answer(NamedTuple):
    """What was said, and whether it holds."""

    verdict: str
    sentence: str


def subjects() -> Iterator[Subject]:
    """All of them."""
    for name in pgraph_models.names():
        model = pg.Model.load(pgraph_models.path(name))
        yield Subject(name, model, None, None)
        for scenario in model.scenarios:
            yield Subject(f"{name}, {scenario.name}", model, scenario.name, None)
    for seed in range(RANDOM):
        yield Subject(f"random tree {seed}", random_tree(seed), None, None)
    for scene in scenes(len(FAMILIES), seed=14):
        if not scene.given:
            yield Subject(f"hunt: {scene.family}", scene.model, None, scene.t_end)


def random_tree(seed: int) -> pg.Model:
    """Up to five bodies on joints of all kinds, in a random state."""
    case = random_case(seed, most=5)
    model, joints = case.model, pg.Mechanism(case.model).joints
    for body, joint in joints.items():  # at home a ball and a hinge of one joint may be alike
        model = model.edit(body, q=tuple(case.q[joint.q]), v=tuple(case.v[joint.v]))
    return model


def of_map(subject: Subject, **options: Any) -> Answer:
    """The advice of the map, tried on the model as it is, or on the first one that it is for."""
    if subject.t_end is not None:
        options = {"steps": [subject.t_end * part for part in PARTS], **options}
    try:
        found = pg.stability_map(
            subject.model, scenario=subject.scenario, t_end=subject.t_end, **options
        )
    except pg.InputError as refused:
        return Answer(TOLD, str(refused))
    answer = re.match(r"Take (\w+) at a step of (\S+) s", found.advice)
    if answer is None:
        return Answer(TOLD if found.advice.startswith("No method") else WRONG, found.advice)
    method, step = answer[1], float(answer[2])
    right = [c for c in found.cells if (c.method, c.status) == (method, "OK")]
    values = [c.value for c in right if f"{c.step:g}" == f"{step:g}"]
    if not values:
        return Answer(WRONG, found.advice)
    value = found.own if found.own in values else values[0]
    model, _ = in_scenario(subject.model, subject.scenario)
    mech = pg.Mechanism(AXES[found.axis].applied(model, value))
    given = {"t_end": found.t_end, "frames": FRAMES, "estimate": False}
    run = pg.simulate(mech, method=method, step=step, **given)
    other = by_another_method(mech, method, step, **given)
    if other is None:
        return Answer(WRONG, f"{found.advice} (no other method reaches the end)")
    off = float(joint_errors(mech, run.q, other.q).max())
    return _judged(off, 1.5 * found.target, found.advice)


def of_report(subject: Subject, **options: Any) -> Answer:
    """The answer of the report for an error of 1e-5, tried."""
    mech, scenario = pg.Mechanism(subject.model), subject.scenario
    chosen = {"frames": FRAMES, "rounds": 1, "longest": 0.5, "target": 1e-5, **options}
    if subject.t_end is not None:
        chosen["t_end"] = subject.t_end
    try:
        found = pg.work_precision(mech, scenario=scenario, **chosen)
    except pg.InputError as refused:
        return Answer(TOLD, str(refused))
    answer = re.match(r"Take (\w+) at (step|rtol) ([^ :]+)(?: s)?: error (\S+) in ", found.answer)
    if answer is None:
        return Answer(TOLD if found.answer.startswith("No method") else WRONG, found.answer)
    method, kind, number, error = answer.groups()
    given = {"t_end": found.t_end, "frames": FRAMES, "scenario": scenario, "estimate": False}
    run = pg.simulate(mech, method=method, **{kind: float(number)}, **given)
    step = found.t_end / max(run.counters["steps"], 1)
    other = by_another_method(mech, method, step, **given)
    if other is None:
        return Answer(WRONG, f"{found.answer} (no other method reaches the end)")
    observe = observer(mech)
    off = float(rms(differences(observe(run.q), observe(other.q), reach(mech))))
    return _judged(off, 2.0 * float(error.rstrip(",")) + 1e-8, found.answer)


def _judged(off: float, most: float, sentence: str) -> Answer:
    return Answer(HOLDS, sentence) if off < most else Answer(WRONG, f"{sentence} Off by {off:.1e}.")


def by_another_method(
    mech: pg.Mechanism, method: str, step: float, **options: Any
) -> pg.Result | None:
    """The same motion, tightly, by a method that was not advised; else by a step a tenth."""
    impulses = Task(mech, None, None, np.zeros(1), options.get("scenario")).impulses
    tight = ("dop853", "dopri5") if impulses else ("dop853", "radau5", "dopri5")
    tries: list[tuple[str, dict[str, float]]] = [
        (other, {"rtol": 1e-11, "max_steps": 1_000_000}) for other in tight if other != method
    ]
    for other, setting in [
        *tries,
        ("rk4", {"step": step / 10}),
        ("moreau_jean", {"step": step / 10}),
    ]:
        try:
            run = pg.simulate(mech, method=other, **setting, **options)
        except pg.InputError:
            continue
        if run.status.ok:
            return run
    return None


def main() -> None:
    """The table; with words, of the subjects whose names hold one of them."""
    print(f"Measured on {machine()['cpu']}.\n\n| subject | map | report | processor time |")
    print("| --- | --- | --- | --- |", flush=True)
    counts: dict[str, Counter[str]] = {"map": Counter(), "report": Counter()}
    sentences: list[str] = []
    for subject in subjects():
        if sys.argv[1:] and not any(word in subject.name for word in sys.argv[1:]):
            continue
        began, cells = time.process_time(), []
        for name, asked in (("map", of_map), ("report", of_report)):
            answer = asked(subject)
            counts[name][answer.verdict] += 1
            cells.append(answer.verdict)
            if answer.verdict != HOLDS:
                sentences.append(f"* {subject.name}, {name}: {answer.sentence}")
        spent = time.process_time() - began
        print(f"| {subject.name} | {cells[0]} | {cells[1]} | {spent:.1f} s |", flush=True)
    for name, found in counts.items():
        print(f"\n{name}s: " + ", ".join(f"{n} {verdict}" for verdict, n in found.items()))
    print("\n" + "\n".join(sentences))


if __name__ == "__main__":
    main()

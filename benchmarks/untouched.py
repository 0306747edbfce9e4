"""What never touches costs nothing: `python -m benchmarks.untouched [--rounds 40]`.

Limits at ±1000, a ground and a ball 1 km away, an inactive constraint, on two and on six rods, by
every method: whether states have the same bits as without them, processor time of whole calls and
the largest memory over those without. Calls alternate, and the fastest of all rounds counts.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Iterator
from typing import Any

import numpy as np

import pgraph_core as pg

from .machine import machine

STEP = 1e-3
SPANS = (0.02, 0.1, 2.0)  # s of whole calls
LONG = SPANS[-1]  # whose memory is measured
EVERY = 2e-3  # s between frames
SAMPLE = 2e-3  # s: a sample of short calls lasts at least as long
METHODS: dict[str, dict[str, Any]] = {
    "semi_implicit_euler": {"step": STEP},
    "rk4": {"step": STEP},
    "gauss6": {"step": STEP},
    "generalised_alpha": {"step": STEP},
    "dopri5": {},
    "dop853": {},
    "radau5": {},
}
GOAL = 1.05


def rods(count: int, **fields: Any) -> list[pg.Body]:
    """Rods of 1 m and 1 kg on one another, hinged about y, with a ball at the middle of each."""
    ball: Any = {"kind": "sphere", "radius": 0.1}
    return [
        pg.Body(
            name=f"b{k}", parent=f"b{k - 1}" if k else "ground", axes=((0, 1, 0),), mass=1.0,
            link=(1.0 if k else 0.0, 0, 0), com=(0.5, 0, 0), inertia=np.eye(3) / 12, shape=ball,
            **fields,
        )
        for k in range(count)
    ]  # fmt: skip


def pairs(count: int) -> Iterator[tuple[str, pg.Model, pg.Model]]:
    """(what is added, the model without it, the model with it)."""
    plain = rods(count)
    ball: Any = {"kind": "sphere", "radius": 0.1}
    away = [*plain, pg.Body(name="away", joint="weld", link=(1000.0, 0, 0), shape=ball)]
    flat = pg.Ground(steps=(pg.Step(low=(-1e4, -1e4), high=(1e4, 1e4), height=-1000.0),))
    names = [b.name for b in plain]
    touch = tuple(pg.Contact(name=f"c{n}", body=n) for n in names)
    meet = tuple(pg.Contact(name=f"c{n}", body=n, other="away") for n in names)
    weld = pg.Constraint(name="weld", kind="weld", body="b1", active=False)
    limited = rods(count, limits=(-1e3, 1e3))
    yield "limits of ±1000", pg.Model(bodies=plain), pg.Model(bodies=limited)
    for law in ("complementarity", "soft"):
        ground, far = ([c.model_copy(update={"law": law}) for c in some] for some in (touch, meet))
        yield (
            f"the ground 1 km below, {law}",
            pg.Model(bodies=plain, ground=flat),
            pg.Model(bodies=plain, ground=flat, contacts=ground),
        )
        yield f"a ball 1 km away, {law}", pg.Model(bodies=away), pg.Model(bodies=away, contacts=far)
    yield "an inactive weld", pg.Model(bodies=plain), pg.Model(bodies=plain, constraints=(weld,))


def options(method: str, span: float) -> dict[str, Any]:
    """Of `simulate`."""
    frames = round(span / EVERY) + 1
    return {"t_end": span, "frames": frames, "method": method, "estimate": False, **METHODS[method]}


def ratio(mechs: list[pg.Mechanism], call: dict[str, Any], rounds: int) -> float:
    """Processor time of the second one's call over that of the first one's."""
    begin = time.process_time()
    pg.simulate(mechs[0], **call)
    count = max(1, round(SAMPLE / max(time.process_time() - begin, 1e-6)))
    best = [np.inf, np.inf]
    for _ in range(rounds):
        for k, mech in enumerate(mechs):
            begin = time.process_time()
            for _ in range(count):
                pg.simulate(mech, **call)
            best[k] = min(best[k], (time.process_time() - begin) / count)
    return best[1] / best[0]


def memory(mech: pg.Mechanism, call: dict[str, Any]) -> int:
    """The most bytes that a call holds at once, its result included."""
    tracemalloc.start()
    run = pg.simulate(mech, **call)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert run.status.ok
    return most


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=40)
    rounds = parser.parse_args().rounds
    print(f"Measured on {machine()['cpu']}.\n")
    heads = " | ".join(f"time, {span:g} s" for span in SPANS)
    print(f"| rods | what | method | same bits | {heads} | memory |")
    print("|---" * (5 + len(SPANS)) + "|")
    missed, cells = 0, 0
    for count in (2, 6):
        for what, without, given in pairs(count):
            mechs = [pg.Mechanism(without), pg.Mechanism(given)]
            for method in METHODS:
                calls = [options(method, span) for span in SPANS]
                runs = [pg.simulate(mech, **calls[-1]) for mech in mechs]
                same = all(
                    np.array_equal(getattr(runs[0], x), getattr(runs[1], x)) for x in ("q", "v")
                )
                times = [ratio(mechs, c, rounds if c is not calls[-1] else 5) for c in calls]
                room = [memory(mech, calls[-1]) for mech in mechs]
                times.append(room[1] / room[0])
                missed, cells = missed + sum(x > GOAL for x in times), cells + len(times)
                said = " | ".join(f"{x:.2f}" for x in times)
                print(f"| {count} | {what} | {method} | {same} | {said} |", flush=True)
    print(f"\n{missed} of {cells} ratios are above {GOAL:g}.")


if __name__ == "__main__":
    main()

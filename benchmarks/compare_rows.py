"""The rows of `benchmarks.compare`, run by the package of the working directory's checkout.

A script of its own: it uses public names that both commits have and imports nothing from this
folder. It prints {row: problem or ""} once all rows are warm, then one number for each row named on
stdin: seconds of the processor a call, the minimum of a few samples: other programs that run on the
machine count little.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg

MODELS = Path.cwd() / "static_models"
SHORTEST = 2e-3  # [s] of a sample
SAMPLES = 3

Call = Callable[[], object]
Row = Callable[[], Call]  # prepares the call that is timed


def mechanism(name: str) -> pg.Mechanism:
    """A built-in model's mechanism."""
    return pg.Mechanism(pg.Model.load(MODELS / f"{name}.json"))


def chain(n: int) -> pg.Mechanism:
    """A serial chain of hinges."""
    return pg.Mechanism(pg.Model.serial(n))


def state_of(mech: pg.Mechanism) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The initial position, random velocities and torques."""
    rng = np.random.default_rng(7)
    q, v = mech.home()
    return q, 0.2 * rng.normal(size=len(v)), rng.normal(size=len(v))


def forward_dynamics(mech: pg.Mechanism) -> Call:
    q, v, tau = state_of(mech)
    return lambda: mech.forward_dynamics(q, v, tau)


def mass_matrix() -> Call:
    mech = mechanism("quadruped")
    q = mech.home()[0]
    return lambda: mech.mass_matrix(q)


def run(mech: pg.Mechanism, **options: Any) -> Call:
    """A whole call of `simulate`."""
    return lambda: pg.simulate(mech, **options)


def simulated(mech: pg.Mechanism, steps: int, step: float, **options: Any) -> Call:
    """A whole call of `simulate` from a state with velocities."""
    q, v, _ = state_of(mech)
    given = {"t_end": steps * step, "step": step, **options}
    return lambda: pg.simulate(mech, q, v, **given)


def scenario(name: str, which: str, **options: Any) -> Call:
    """A whole call of `simulate` with a scenario."""
    return run(mechanism(name), scenario=which, **options)


def bouncing() -> Call:
    """A ball on the ground by time stepping."""
    ball = pg.Body(name="ball", joint="free", mass=1.0, q=(0, 0, 0.1, 1, 0, 0, 0))
    touch = pg.Contact(name="floor", body="ball", points=((0, 0, 0),), restitution=0.5)
    mech = pg.Mechanism(pg.Model(bodies=(ball,), contacts=(touch,)))
    return run(mech, t_end=0.5, step=1e-3, method="moreau_jean", estimate=False)


def loaded(name: str) -> Call:
    text = (MODELS / f"{name}.json").read_text(encoding="utf-8")
    return lambda: pg.Mechanism(pg.Model.from_json(text))


def moved() -> Call:
    """One body hung elsewhere."""
    mech = pg.Mechanism(pg.Model(bodies=mechanism("quadruped").model.bodies))
    return lambda: mech.edit("left_hind_paw", parent="left_femur")


def edited() -> Call:
    mech, turns = mechanism("quadruped"), iter(range(10**12))
    return lambda: mech.edit("pelvis", mass=10.0 + 0.1 * (next(turns) % 2))


def stance() -> Call:
    mech = mechanism("quadruped")
    q, v, tau = mech.home()[0], mech.home()[1], np.zeros(mech.nv)
    return lambda: mech.constrained_dynamics(q, v, tau)


EULER = {"method": "semi_implicit_euler", "frames": 2}
ROWS: dict[str, Row] = {
    "forward_dynamics, quadruped": lambda: forward_dynamics(mechanism("quadruped")),
    "forward_dynamics, chain of 1000": lambda: forward_dynamics(chain(1000)),
    "mass_matrix, quadruped": mass_matrix,
    "constrained_dynamics, quadruped": stance,
    "simulate, 1 step, chain of 20": lambda: simulated(chain(20), 1, 1e-3, **EULER),
    "simulate, 500 steps, chain of 20": lambda: simulated(chain(20), 500, 1e-3, **EULER),
    "simulate, 500 steps, chain of 20, no estimate": lambda: simulated(
        chain(20), 500, 1e-3, estimate=False, **EULER
    ),
    "simulate, 500 steps of rk4, chain of 20, no estimate": lambda: simulated(
        chain(20), 500, 1e-3, method="rk4", frames=2, estimate=False
    ),
    "simulate, 101 frames, double pendulum": lambda: simulated(
        mechanism("double_pendulum"), 100, 1e-3, method="rk4"
    ),
    "simulate, dop853 to 1e-10, double pendulum": lambda: run(
        mechanism("double_pendulum"), t_end=1.0, rtol=1e-10, method="dop853"
    ),
    "simulate, radau5 to 1e-6, stiff pendulum": lambda: run(
        mechanism("stiff_pendulum"), t_end=0.2, rtol=1e-6, method="radau5"
    ),
    "simulate, scenario stance": lambda: scenario("quadruped", "stance", frames=2),
    "simulate, scenario trot, 0.1 s": lambda: scenario(
        "quadruped_hips", "trot", t_end=0.1, step=1e-3, frames=2, estimate=False
    ),
    "simulate, bouncing ball by moreau_jean": bouncing,
    "Model.from_json and Mechanism, quadruped": lambda: loaded("quadruped"),
    "Mechanism.edit of a mass, quadruped": edited,
    "Mechanism.edit of a parent, quadruped": moved,
}


def prepared(names: list[str]) -> tuple[dict[str, tuple[Call, int]], dict[str, str]]:
    """(the warm calls with the number of them in a sample, the problem of each row or "")."""
    calls: dict[str, tuple[Call, int]] = {}
    problems: dict[str, str] = {}
    for name in names:
        try:
            call = ROWS[name]()
            call()  # compiles
            begin = time.perf_counter()
            call()
            took = time.perf_counter() - begin
        except Exception as error:  # of this commit: the row is left out
            problems[name] = f"{type(error).__name__}: {error}".splitlines()[0]
            continue
        calls[name], problems[name] = (call, max(1, int(SHORTEST / max(took, 1e-7)))), ""
    return calls, problems


def sample(call: Call, n: int) -> float:
    """Seconds of the processor a call, the minimum of a few samples of n calls."""
    found = []
    for _ in range(SAMPLES):
        begin = time.process_time()
        for _ in range(n):
            call()
        found.append((time.process_time() - begin) / n)
    return min(found)


def main(names: list[str]) -> None:
    """Answer names on stdin with seconds on stdout."""
    calls, problems = prepared(names or list(ROWS))
    print(json.dumps(problems), flush=True)
    gc.disable()
    for line in sys.stdin:
        gc.collect()
        print(json.dumps(sample(*calls[line.strip()])), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

"""Verdicts on a fixed set of scenes, which do not depend on the exact numbers of tolerances.py.

    python -m tests.verdicts [NAME=FACTOR ...]

prints them as JSON, after multiplying each number NAME of tolerances.py by its FACTOR in Python.
Kernels keep the numbers of the file.
"""

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

SOURCE = Path(__file__).parents[1] / "pgraph_core" / "tolerances.py"


def vary(factors: dict[str, float]) -> None:
    """Multiply numbers of tolerances.py, before anything imports it."""
    assert "pgraph_core" not in sys.modules
    spec = importlib.util.spec_from_file_location("pgraph_core.tolerances", SOURCE)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, factor in factors.items():
        setattr(module, name, getattr(module, name) * factor)
    sys.modules[spec.name] = module


def mobilities() -> dict[str, Any]:
    """Ranks, redundant rows and branches, at regular and singular positions."""
    from tests.worlds import built_in

    flat, along = np.array([-np.pi / 2, np.pi / 2, -np.pi / 2]), np.array([-1.0, 1.0, -1.0])
    reports = {
        name: built_in(name).mobility()
        for name in ("four_bar", "slider_crank", "bricard", "andrews", "quadruped", "rolling_disc")
    }
    reports["flat"] = built_in("four_bar").mobility(flat, along)
    reports["nearly flat"] = built_in("four_bar").mobility(flat + 0.02 * along, along)
    return {
        name: [r.rank, r.dof, r.extra, r.finite, r.branch, len(r.branches), r.joints]
        + [str(row) for row in r.redundant]
        for name, r in reports.items()
    }


def assemblies() -> dict[str, Any]:
    """States that constraints move, and constraints that contradict each other."""
    import pgraph_core as pg
    from tests.worlds import built_in

    found: dict[str, Any] = {}
    random = np.random.default_rng(3)
    for name in ("four_bar", "slider_crank", "andrews", "bricard"):
        mech = built_in(name)
        q, v = mech.home()
        for size in (0.0, 1e-3, 0.1):
            met, _, report = mech.assemble(q + size * random.normal(size=mech.nq), v)
            again = mech.assemble(met, v)[2]
            place = met.tolist() if size < 0.1 else []  # from afar, steps decide where it is
            found[f"{name} {size}"] = [report.notable, again.notable, *place]
    rod = pg.Body(name="rod", axes=(0, 1, 0), com=(0.5, 0, 0), tip=(1, 0, 0))
    held = [
        pg.Motion(name=name, body="rod", q_of_t={"t": (0, 1), "value": (x, x)})
        for name, x in (("left", 0.2), ("right", 0.2 + 1e-4))
    ]
    try:
        pg.Mechanism(pg.Model(bodies=[rod], constraints=held)).assemble()
    except pg.InputError as error:
        found["contradiction"] = sorted(n for n in ("left", "right") if f"'{n}'" in str(error))
    return found


def positions() -> dict[str, Any]:
    """Equilibria, targets of inverse kinematics, torques of loops, small motions."""
    import pgraph_core as pg
    from tests.worlds import built_in

    rod = {"mass": 1.0, "com": (0.5, 0, 0), "tip": (1, 0, 0), "axes": (0, 1, 0)}
    upper = pg.Body(name="a", limits=((-1.0, 1.0),), **rod)
    lower = pg.Body(name="b", parent="a", link=(1, 0, 0), **rod)
    mech = pg.Mechanism(pg.Model(bodies=[upper, lower]))
    found: dict[str, Any] = {
        f"rest from {q}": mech.equilibrium(q).tolist()
        for q in ([0.0, 0.0], [3.0, 0.0], [-1.0, 1.0], [1.0 - 1e-16, 0.5])
    }
    free = pg.Mechanism(pg.Model(bodies=[upper.model_copy(update={"limits": None}), lower]))
    upright = [-np.pi / 2, 0.0]
    found["upright"] = free.equilibrium(upright).tolist()
    for name, place in (("near", (1.2, 0.0, 0.9)), ("far", (1.2, 0.0, 2.0))):
        try:
            q = free.inverse_kinematics({"b": {"place": place, "point": (1, 0, 0)}})
            point, turn = free.pose(q, "b")
            found[name] = (point + turn @ np.array([1.0, 0, 0])).tolist()
        except pg.InputError:
            found[name] = "refused"
    for name in ("four_bar", "slider_crank", "andrews"):
        mech = built_in(name)
        q, v, _ = mech.assemble()
        vdot = mech.constrained_dynamics(q, v, np.ones(mech.nv))[0]
        found[f"torque {name}"] = mech.constrained_inverse_dynamics(q, v, vdot).tolist()
        try:
            mech.constrained_inverse_dynamics(q, v, vdot + 1.0)
            found[f"forbidden {name}"] = "possible"
        except pg.InputError:
            found[f"forbidden {name}"] = "refused"
    small = free.linearise(found["upright"], np.zeros(2))
    found["small"] = [small.conservative, *np.sort(np.abs(small.eigenvalues)).tolist()]
    return found


def carrying() -> dict[str, Any]:
    """Motions that friction allows or not, points that touch or not, joints without actuators."""
    import pgraph_core as pg
    from tests.worlds import box, on_ground

    mech = pg.Mechanism(on_ground(box("cube", (0, 0, 0.5), (1, 1, 1), mass=2.0), friction=0.5))
    q, v = mech.home()
    found: dict[str, Any] = {}
    for lift in (0.0, 1e-5, 0.2):
        for along in (0.9, 0.999, 1.01):
            up, push = np.zeros(7), np.zeros(6)
            up[2], push[3] = lift, along * 0.5 * 9.81
            try:
                mech.constrained_inverse_dynamics(q + up, v, push, actuated=[], contacts=["floor"])
                found[f"{lift} {along}"] = "reached"
            except pg.InputError as error:
                found[f"{lift} {along}"] = "touch" if "touch" in str(error) else "slip"
    chain = pg.Mechanism(pg.Model.serial(4))
    q, v = chain.home()
    try:
        chain.constrained_inverse_dynamics(q, v, np.array([1.0, 0, 0, 0]), actuated=["4"])
    except pg.InputError as error:
        found["missing"] = str(error).partition("joints of ")[2].partition(";")[0]
    return found


def runs() -> dict[str, Any]:
    """Ends, statuses and notices of runs with loops, spins, singular positions and extremes."""
    import pgraph_core as pg
    from tests.worlds import built_in

    found: dict[str, Any] = {}
    cases: list[tuple[str, str, dict[str, Any]]] = [
        ("four_bar", "turn", {"t_end": 1.0, "method": "rk4", "step": 1e-3}),
        ("four_bar", "turn", {"t_end": 1.0, "method": "dop853", "rtol": 1e-9}),
        ("slider_crank", "turn", {"t_end": 0.5, "method": "dop853", "rtol": 1e-9}),
        ("andrews", "", {"t_end": 0.02, "method": "radau5", "rtol": 1e-8}),
        ("bricard", "", {"t_end": 0.5, "method": "dop853", "rtol": 1e-9}),
        ("tennis_racket", "", {"t_end": 1.0, "method": "semi_implicit_euler", "step": 1e-3}),
        ("heavy_top", "", {"t_end": 1.0, "method": "dop853", "rtol": 1e-10}),
        ("chain_10", "", {"t_end": 0.5, "method": "dop853", "rtol": 1e-9}),
    ]
    for name, scenario, how in cases:
        run = pg.simulate(built_in(name), scenario=scenario or None, estimate=False, **how)
        facts = [word for word in ("singular", "redundant") if word in " ".join(run.notices)]
        drift = float(np.max(run.constraint_drift, initial=0.0)) < 1e-8
        key = f"{name} {how['method']}"
        found[key] = [run.status.name, drift, *facts, *np.round(run.q[-1], 7).tolist()]
    return found


SCENES = (mobilities, assemblies, positions, carrying, runs)


def differences(one: Any, other: Any, where: str = "") -> list[str]:
    """Return the differences of two sets of verdicts, of numbers by more than 1e-6."""
    if isinstance(one, dict):
        return [d for k in one for d in differences(one[k], other.get(k), f"{where} {k}")]
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return [d for a, b in zip(one, other) for d in differences(a, b, where)]
    if isinstance(one, float) and isinstance(other, float):
        same = abs(one - other) <= 1e-6 * max(1.0, abs(one))
    else:
        same = one == other
    return [] if same else [f"{where.strip()}: {one!r}, {other!r}"]


if __name__ == "__main__":
    given = (text.split("=") for text in sys.argv[1:])
    vary({name: float(factor) for name, factor in given})
    print(json.dumps({scene.__name__: scene() for scene in SCENES}))

"""Derivatives of random scenes against differences of their runs: none is wrong without a warning.

A scene has up to five joints, some with limits, restitution or friction, springs, and any method.
Others have drives that reach their limits, cables, stops and dampers of two slopes.
"""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import at_night
from ..random_models import random_model
from .test_gradients import state

SCENES = 200
SMOOTH = ("rk4", "semi_implicit_euler", "gauss6", "dop853", "radau5")
HELD: dict[str, Any] = {"estimate": False, "frames": 11, "t_end": 0.3}
CLOSE = 1e-5  # of the largest derivative: of impacts, to which differences are good to about 1e-6


def scene(seed: int) -> tuple[pg.Model, list[str], dict[str, Any]]:
    """A model, three paths in it, and arguments of `simulate`."""
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "prismatic") if seed % 2 else ("revolute", "prismatic", "universal")
    model = random_model(rng, int(rng.integers(1, 6)), kinds)
    bounded = seed % 2 == 1
    springs: list[Any] = []
    paths = ["gravity.2"]
    for body in model.bodies:
        n = len(body.motions)
        change: dict[str, Any] = {"q": rng.uniform(-0.5, 0.5, n), "v": rng.normal(0, 2, n)}
        paths += [f"bodies.{body.name}.mass", f"bodies.{body.name}.com.0"]
        paths += [f"{kind}.{body.name}" for kind in "qv" if n == 1]
        if bounded and rng.random() < 0.7:
            low, high = change["q"][0] - rng.uniform(0.05, 0.6), change["q"][0] + 0.3
            change |= {"limits": [(low, high)], "limit_restitution": (rng.choice([0.0, 0.5, 1.0]),)}
            paths += [f"bodies.{body.name}.limits.0.{k}" for k in (0, 1)]
        elif bounded and rng.random() < 0.5:
            change["friction"] = (float(rng.uniform(0.1, 4.0)),)
            paths.append(f"bodies.{body.name}.friction.0")
        model = model.edit(body.name, **change)
        rest, stiffness = rng.uniform(0, 1), rng.uniform(1, 80)
        spring = pg.Spring(
            name=f"s_{body.name}", body=body.name, other="ground",
            point=tuple(rng.normal(0, 0.3, 3)), other_point=tuple(rng.normal(0, 1, 3)),
            stiffness=stiffness, rest=rest,
        )  # fmt: skip
        springs.append(spring)
        paths.append(f"forces.{spring.name}.stiffness")
    model = pg.Model(bodies=model.bodies, gravity=model.gravity, forces=springs)
    bounded = any(body.limits or any(body.friction) for body in model.bodies)
    method = "moreau_jean" if bounded else str(rng.choice(SMOOTH))
    adaptive = method in ("dop853", "radau5")
    options: dict[str, Any] = (
        {"rtol": 1e-10} if adaptive else {"step": float(rng.choice([1e-3, 3e-3]))}
    )
    chosen = rng.choice(paths, min(3, len(paths)), replace=False).tolist()
    return model, chosen, HELD | options | {"method": method}


def bent(seed: int) -> tuple[pg.Model, list[str], dict[str, Any]]:
    """A model with forces that have bends, three paths in it, and arguments of `simulate`."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, int(rng.integers(1, 5)), ("revolute", "prismatic"))
    forces: list[Any] = []
    paths = ["gravity.2"]
    for body in model.bodies:
        name = body.name
        change = {"q": rng.uniform(-0.5, 0.5, 1), "v": rng.normal(0, 2, 1)}
        model = model.edit(name, **change)
        paths += [f"bodies.{name}.mass", f"q.{name}", f"v.{name}"]
        target = rng.choice([0.0, 1.0]) * rng.normal()
        given: dict[str, Any] = {"kp": rng.uniform(5, 60), "kd": rng.uniform(0.0, 4.0)}
        given |= {"target": float(target), "torque_limit": rng.uniform(0.3, 6.0)}
        kind = rng.integers(5)
        if kind == 1:
            given["target"] = pg.Table(t=(0.0, 0.1, 0.3), value=tuple(rng.normal(0, 1, 3)))
        elif kind == 2:
            given["target"] = f"={target} + 0.5*sin(9*t) + 0.1*v.{name}"
        elif kind == 3:
            given |= {"lag": 0.05, "start": 0.0, "torque_low": -rng.uniform(0.1, 1.0)}
        drive = pg.Servo(name=f"d_{name}", body=name, **given)
        low, rest = rng.uniform(0.2, 0.6), rng.uniform(0.6, 1.2)
        strut = pg.Strut(
            name=f"s_{name}", body=name, other="ground",
            point=tuple(rng.normal(0, 0.3, 3)), other_point=tuple(rng.normal(0, 1, 3)),
            spring={"x": (low, rest, rest + 1), "value": (0.0, 0.0, rng.uniform(5, 80))},
            damper={"x": (-1, 0, 1), "value": (-rng.uniform(0, 3), 0, rng.uniform(0, 9))},
            bump_length=rng.uniform(0.3, 1.2), bump_stiffness=rng.uniform(20, 200),
            bump_damping=rng.choice([0.0, 0.5]),
        )  # fmt: skip
        if kind != 4:
            forces.append(drive)
            paths += [f"forces.d_{name}.{x}" for x in ("torque_limit", "kp", "kd")]
        if kind == 4 or rng.random() < 0.5:
            forces.append(strut)
            paths += [f"forces.s_{name}.{x}" for x in ("bump_stiffness", "bump_length")]
    model = pg.Model(bodies=model.bodies, gravity=model.gravity, forces=forces)
    method = str(rng.choice(SMOOTH))
    adaptive = method in ("dop853", "radau5")
    options: dict[str, Any] = (
        {"rtol": 1e-12} if adaptive else {"step": float(rng.choice([1e-3, 3e-3]))}
    )
    chosen = rng.choice(paths, min(3, len(paths)), replace=False).tolist()
    return model, chosen, HELD | options | {"method": method}


def moved(model: pg.Model, path: str, change: float, options: dict[str, Any]) -> Any:
    """The states of the run with another number, NaN where it fails."""
    kind, name, *rest = path.split(".")
    if kind in "qv":
        value = np.array(getattr(model.body(name), kind), float) + change
        return state(pg.simulate(model.edit(name, **{kind: value}), **options))
    if kind == "gravity":
        gravity = np.array(model.gravity)
        gravity[int(name)] += change
        other = pg.Model(bodies=model.bodies, forces=model.forces, gravity=gravity)
        return state(pg.simulate(other, **options))
    field, entries = rest[0], [int(k) for k in rest[1:]]
    part = next(x for x in (*model.bodies, *model.forces) if x.name == name)
    value = np.array(getattr(part, field), float)
    value[tuple(entries)] += change
    value = value.tolist() if entries else float(value)
    return state(pg.simulate(model.edit(name, **{field: value}), **options))


def judged(seed: int, scene: Any = scene) -> dict[str, str]:
    """Whether each derivative of a scene is "right", "warned", "unknown" or else how it is wrong.

    Differences over two widths that do not agree with each other know no derivative.
    """
    model, paths, options = scene(seed)
    run = pg.simulate(model, wrt=paths, **options)
    plain = pg.simulate(model, **options)
    assert all(np.array_equal(getattr(run, x), getattr(plain, x)) for x in ("q", "v", "vdot"))
    warned = any("derivative" in text for text in run.notices)
    found = {}
    for path in paths:
        size = 1e-5
        wide, narrow = (
            (moved(model, path, h, options) - moved(model, path, -h, options)) / (2 * h)
            for h in (size, size / 2)
        )
        mine = run.sensitivity(path)
        largest = max(1.0, float(np.abs(narrow).max()))
        known = np.isfinite(mine).all(axis=1)
        off = np.abs(mine - narrow)[known].max(initial=0.0) / largest
        apart = np.abs(wide - narrow)[known].max(initial=0.0) / largest
        if off <= CLOSE + 3.0 * apart and apart < CLOSE:
            found[path] = "right" if known.all() else "warned" if warned else "nan, unsaid"
        elif apart >= CLOSE:
            found[path] = "unknown"
        else:
            found[path] = "warned" if warned else f"{off:.1e} of {largest:.2g} off"
    return found


@pytest.mark.parametrize(
    "seed", [0, 1, 91, *at_night(*range(2, 10))]
)  # 91 has a step without restitution
@pytest.mark.parametrize("kind", [scene, bent])
def test_derivatives_of_random_scenes(kind, seed):
    found = judged(seed, kind)
    assert {*found.values()} <= {"right", "warned", "unknown"}, found


@pytest.mark.nightly
@pytest.mark.parametrize("kind", [scene, bent])
def test_derivatives_of_many_random_scenes(kind):
    """At most one in fifty may be beyond the differences' reach."""
    found = {seed: judged(seed, kind) for seed in range(SCENES)}
    verdicts = [verdict for each in found.values() for verdict in each.values()]
    wrong = {seed: each for seed, each in found.items() if any(" " in x for x in each.values())}
    assert not wrong
    assert verdicts.count("unknown") * 50 <= len(verdicts)

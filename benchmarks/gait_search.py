"""Finds the numbers of a gait: `python -m benchmarks.gait_search trot [--generations N]`, by hand.

Cross entropy: gaits are drawn about the best ones so far, each runs some seconds from a push, and
what counts is falling, tilting, missing its speed, slipping, pounding, and not repeating itself.
"""

from __future__ import annotations

import argparse
import multiprocessing
from functools import partial

import numpy as np

import pgraph_core as pg
import pgraph_models

FALLEN = 1000.0  # cost of a fall, less 100 a second before it
STEP = 1e-3

# what is searched: field, or field of its gains, or footfalls; first spread of it
SPREADS: dict[str, dict[str, float]] = {
    "crawl": {
        "sway.0": 0.01, "sway.1": 0.01, "width": 0.02, "landing": 0.06, "loading": 0.04,
        "least": 4, "speed": 3, "drift": 3, "sway": 10, "roll.0": 50, "roll.1": 10,
        "pitch.0": 50, "pitch.1": 10, "place": 0.04, "place_drift": 0.05, "place_roll": 0.05,
        "tight_torque": 4, "tight_force": 3,
    },
    "trot": {
        "width": 0.015, "landing": 0.08, "loading": 0.04, "least": 4, "speed": 4, "drift": 3,
        "sway": 5, "roll.0": 40, "roll.1": 12, "pitch.0": 60, "pitch.1": 12, "place": 0.03,
        "place_drift": 0.05, "place_roll": 0.05, "tight_torque": 5, "tight_force": 2,
    },
    "bound": {
        "front": 0.03, "duty_front": 0.04, "duty_hind": 0.04, "ahead_front": 0.02,
        "ahead_hind": 0.02, "height": 0.015, "stride": 0.03, "landing": 0.1, "loading": 0.08,
        "push": 0.03, "nod": 0.2, "flexion.0": 0.03, "flexion.1": 0.03, "speed": 2, "height.0": 20,
        "height.1": 4, "pitch.0": 15, "pitch.1": 4, "place": 0.02, "tight_torque": 4,
        "tight_force": 1.5,
    },
}  # fmt: skip
SPREADS["gallop"] = SPREADS["bound"] | {
    "lead_front": 0.03, "lead_hind": 0.03, "width": 0.02, "drift": 2, "roll.0": 40, "roll.1": 10,
    "place_drift": 0.04, "place_roll": 0.04,
}  # fmt: skip
BOUNDS = {
    "width": (0.0, 0.08), "loading": (0.08, 0.4), "duty_front": (0.2, 0.5), "least": (2.0, 25.0),
    "duty_hind": (0.2, 0.5), "height": (0.42, 0.55), "stride": (0.26, 0.5), "landing": (0.05, 0.5),
    "tight_torque": (2.0, 40.0), "tight_force": (1.5, 20.0),
}  # fmt: skip


def value(gait: pg.Gait, name: str) -> float:
    """A number of a gait by the name it is searched under."""
    field, _, i = name.partition(".")
    front, hind = gait.feet[0], gait.feet[2]
    match field:
        case "front":
            return front.offset
        case "duty_front" | "duty_hind":
            return (front if field == "duty_front" else hind).duty
        case "ahead_front" | "ahead_hind":
            return (front if field == "ahead_front" else hind).ahead
        case "lead_front":
            return gait.feet[1].offset - front.offset
        case "lead_hind":
            return gait.feet[3].offset - hind.offset
    if i and field in pg.Gait.model_fields and field not in pg.Gains.model_fields:
        return getattr(gait, field)[int(i)]
    if i and field == "sway" and name in ("sway.0", "sway.1"):
        return gait.sway[int(i)]
    if i:
        return getattr(gait.gains, field)[int(i)]
    own = field in pg.Gait.model_fields and field not in ("speed", "drift", "sway")
    return getattr(gait if own else gait.gains, field)


def changed(gait: pg.Gait, numbers: dict[str, float]) -> pg.Gait:
    """A gait with these numbers."""
    feet = [fall.model_dump() for fall in gait.feet]
    gains = gait.gains.model_dump()
    fields: dict[str, object] = {}
    waves = {name: list(getattr(gait, name)) for name in ("sway", "flexion")}
    get = numbers.get
    for k, fall in enumerate(feet):
        end = "front" if k < 2 else "hind"
        fall["duty"] = get(f"duty_{end}", fall["duty"])
        fall["ahead"] = get(f"ahead_{end}", fall["ahead"])
        if "front" in numbers:
            lead = get(f"lead_{end}", 0.0) if k % 2 else 0.0
            fall["offset"] = ((get("front", 0.0) if k < 2 else 0.0) + lead) % 1.0
    for name, x in numbers.items():
        field, _, i = name.partition(".")
        if i and field in waves and (field == "flexion" or name.startswith("sway.")):
            waves[field][int(i)] = x
        elif i:
            gains[field] = tuple(abs(x) if k == int(i) else y for k, y in enumerate(gains[field]))
        elif field in ("speed", "drift", "sway") or (field in gains and field != "height"):
            gains[field] = x if field.startswith("place") else max(x, 0.0)
        elif field in pg.Gait.model_fields:
            fields[field] = x
    return gait.edit(feet=feet, gains=gains, **waves, **fields)


def cost(mech: pg.Mechanism, gait: pg.Gait, numbers: dict[str, float], t_end: float) -> float:
    """How badly a gait walks [1]; a fall outweighs all else."""
    over = 0.0
    for name, (low, high) in BOUNDS.items():
        if name in numbers:
            x = numbers[name]
            numbers = numbers | {name: min(max(x, low), high)}
            over += 100 * abs(x - numbers[name])
    try:
        walk = pg.Controller(mech, changed(gait, numbers))
    except pg.PgraphError:
        return 2 * FALLEN
    q, v = walk.start()
    v[0], v[5] = 0.2, 0.2 * (mech.nv == 25)
    frames = round(t_end / STEP) + 1
    run = pg.simulate(mech, q, v, t_end=t_end, step=STEP, frames=frames, tau=walk)
    fell = next((text for text in run.notices if "fell" in text), None)
    if fell or not run.status.ok:
        return FALLEN - 100 * (float(fell.split("t = ")[1].split(" s")[0]) if fell else run.t[-1])
    return over + quality(run, walk.gait)


def quality(run: pg.Result, gait: pg.Gait) -> float:
    """Cost of a run that does not fall, from its second half."""
    half = len(run.t) // 2
    v, q = run.v[half:], run.q[half:, 1:]
    n = round(gait.stride / STEP)
    again = 5 * np.abs(q[n:] - q[:-n]).mean() + np.abs(v[n:] - v[:-n]).mean()
    slip = max(
        float(s[half:][np.isfinite(s[half:])].sum()) * STEP for s in run.contact_slip.values()
    )
    slip /= run.t[-1] / 2 / gait.stride  # a stance
    pounding = max(float(np.sort(f[half:])[-20:].mean()) for f in run.contact_normal.values())
    landings = sum("swing" in e.before for e in run.events if e.t > run.t[half])
    extra = landings / (4 * run.t[-1] / 2 / gait.stride) - 1
    wobble = np.abs(v[:, :2]).mean() + 0.3 * np.abs(v[:, 2]).mean() + 2 * v[:, 5].std()
    wobble += abs(float(v[:, 5].mean())) + 2 * abs(float(v[:, 3].mean()) - gait.speed)
    return float(again + 120 * slip + 5e-4 * pounding + 0.2 * max(extra, 0) + wobble)


def search(name: str, gait: pg.Gait, mech: pg.Mechanism, generations: int, t_end: float,
           seed: int = 0) -> pg.Gait:  # fmt: skip
    """The best gait found."""
    names, rng = list(SPREADS[name]), np.random.default_rng(seed)
    mean = np.array([value(gait, key) for key in names])
    spread = np.array(list(SPREADS[name].values()), dtype=float)
    best = np.inf, mean
    score = partial(_score, names, mech, gait, t_end)
    score(mean)  # compiles before it forks
    with multiprocessing.get_context("fork").Pool() as pool:
        for generation in range(generations):
            drawn = mean + spread * rng.standard_normal((28, len(names)))
            drawn[0], drawn[1] = mean, best[1]
            found = np.array(pool.map(score, drawn))
            order = np.argsort(found)[:7]
            if found[order[0]] < best[0]:
                best = found[order[0]], drawn[order[0]]
            weights = np.log(7.5) - np.log(np.arange(1, 8))
            weights /= weights.sum()
            around = np.sqrt(weights @ (drawn[order] - mean) ** 2)
            mean, spread = weights @ drawn[order], 0.7 * around + 0.27 * spread
            print(generation, round(float(best[0]), 4), flush=True)
    return changed(gait, dict(zip(names, np.round(best[1], 4).tolist())))


def _score(names, mech, gait, t_end, numbers) -> float:
    return cost(mech, gait, dict(zip(names, numbers.tolist())), t_end)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("gait", choices=sorted(SPREADS))
    parser.add_argument("--generations", type=int, default=12)
    parser.add_argument("--seconds", type=float, default=5.0)
    args = parser.parse_args()
    gait = pg.gaits()[args.gait]
    model = pg.Model.load(
        pgraph_models.path("quadruped" if args.gait == "bound" else "quadruped_hips")
    )
    contacts = tuple(c.model_copy(update={"active": True}) for c in model.contacts)
    mech = pg.Mechanism(model.replace(contacts=contacts, constraints=(), scenarios=()))
    best = search(args.gait, gait, mech, args.generations, args.seconds)
    print(best.model_dump_json(indent=1))


if __name__ == "__main__":
    main()

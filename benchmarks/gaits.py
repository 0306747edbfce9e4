"""Writes docs/gaits.md: `python -m benchmarks.gaits`. Compares with MuJoCo if it is installed."""

from __future__ import annotations

from pathlib import Path

from .gait_checks import RTOL, Walked, ladder, to_a_tolerance, under_law, walked
from .gait_robustness import PUSH_FOR, SECONDS, table
from .machine import has, machine

PAGE = Path(__file__).parent.parent / "docs" / "gaits.md"
WALKS = (
    ("quadruped_hips", "trot", 30.0),
    ("quadruped_hips", "crawl", 30.0),
    ("quadruped_hips", "gallop", 30.0),
    ("quadruped", "bound", 10.0),
)
TO_RTOL = (
    ("quadruped_hips", "trot", 30.0),
    ("quadruped_hips", "crawl", 30.0),
    ("quadruped_hips", "gallop", 5.0),
)
LAWS = (
    ("soft", "rk4", {"step": 1e-4}),
    ("soft", "dopri5", {"rtol": 1e-6}),
    ("soft", "dopri5", {"rtol": 1e-8}),
    ("penalty", "rk4", {"step": 2.5e-4}),
    ("penalty", "rk4", {"step": 1.25e-4}),
)
START = "<!-- figures: python -m benchmarks.gaits -->"


def main() -> None:
    text = PAGE.read_text(encoding="utf-8").split(START)[0]
    parts = [
        *walks(),
        *ladders(),
        *tolerances(),
        *laws(),
        *beside_mujoco(),
        "## Robustness",
        "",
        *robustness(),
    ]
    PAGE.write_text(text + START + "\n\n" + "\n".join(parts) + "\n", encoding="utf-8")
    print("\n".join(parts))


def walks() -> list[str]:
    found = [walked(*walk) for walk in WALKS]
    return [
        f"Measured on {machine()['cpu']}.",
        "",
        "## Walks on flat ground",
        "",
        "Time stepping at 1 ms, friction 0.7, from a stand. Slip is the farthest way of a sole in",
        "one stance, depth the deepest foot, torque the largest asked for and its limit.",
        "",
        "| gait | model | time [s] | speed [m/s] | aside [m] | tilt [deg] | slip [mm] | "
        "depth [mm] | touches a stride | largest push [weights] | leg [N m] | "
        "spine [N m] | ledger | same bits again |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        *(_row(w) for w in found),
        "",
    ]


def _row(w: Walked) -> str:
    torque = [f"{w.torque[part]:.0f} of {w.limit[part]:.0f}" for part in ("leg", "spine")]
    return (
        f"| {w.gait} | {w.model} | {w.seconds:g}{' ' + w.fell if w.fell else ''} | {w.speed:.3f} | "
        f"{w.aside:.3f} | {w.tilt:.1f} | {1e3 * w.slip:.1f} | {1e3 * w.depth:.1f} | "
        f"{w.touches:.2f} | {w.push:.2f} | {torque[0]} | "
        f"{torque[1]} | {w.energy:.1e} | {'yes' if w.again else 'no'} |"
    )


def ladders() -> list[str]:
    lines = [
        "## Event-driven and time stepping",
        "",
        "1.5 s of each. Touchdown times and the position of the trunk are compared with the finest",
        "event-driven run (rk4); both differences shrink with the step. The energy "
        "balance is off by",
        "O(h) in time stepping, and by O(h⁴), the order of rk4, in event-driven runs.",
        "",
    ]
    for name, gait in (("quadruped_hips", "trot"), ("quadruped", "bound")):
        rungs, ledgers = ladder(name, gait)
        exact = dict(ledgers)
        lines += [
            f"| {gait}: step [ms] | touchdowns apart, median [ms] | trunk apart [mm] | ledger | "
            "ledger, event-driven |",
            "|---|---|---|---|---|",
        ]
        lines += [
            f"| {1e3 * r.step:g} | {1e3 * r.touchdowns:.2f} | {1e3 * r.place:.2f} | "
            + f"{r.energy:.1e} | "
            + (f"{exact[r.step]:.1e} |" if r.step in exact else "too wide for rk4 |")
            for r in rungs
        ] + [""]
    return lines


def tolerances() -> list[str]:
    found = [to_a_tolerance(*walk) for walk in TO_RTOL]
    return [
        "## To a tolerance",
        "",
        f"From event to event with dop853 at rtol {RTOL:g}: steps and events of the whole run,",
        "and the error of the energy balance relative to its range.",
        "",
        "| gait | model | time [s] | steps | changes of phase | impacts | ledger |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {gait} | {model} | {seconds:g} | {run.counters['steps']} | "
            f"{run.counters['phase_switches']} | {run.counters['impacts']} | "
            f"{run.energy_drift:.1e} |"
            for (model, gait, seconds), run in zip(TO_RTOL, found)
        ),
        "",
        "The model with the paper's planar hinges is not in the table. Its two hind feet "
        "cannot move",
        "sideways relative to each other, so in the bound they alternate between stick "
        "and slip more",
        "than a hundred times a millisecond from about 1.87 s on; time stepping passes over that.",
        "",
    ]


def laws() -> list[str]:
    lines = [
        "## The energy balance under soft and penalty laws",
        "",
        "1.5 s of the trot. The friction of `soft` is regularised at 1 mm/s and "
        "therefore stiff. At",
        "0.1 ms rk4 does not resolve it, as its energy balance shows, although the walk "
        "is the same;",
        "a method with a tolerance does.",
        "",
        "| law | method | setting | steps | ledger |",
        "|---|---|---|---|---|",
    ]
    for law, method, setting in LAWS:
        run = under_law(law, method, setting)
        said = ", ".join(f"{name} {value:g}" for name, value in setting.items())
        lines.append(
            f"| {law} | {method} | {said} | {run.counters['steps']} | {run.energy_drift:.1e} |"
        )
    return [*lines, ""]


def beside_mujoco() -> list[str]:
    if not has("mujoco"):
        return []
    from .gait_in_mujoco import controller_call, times

    call = controller_call()
    lines = [
        "## Speed",
        "",
        "The trot, one thread, 1 ms, minimum of many interleaved rounds of half a stride. Ours is",
        "with the controller; MuJoCo's step has its own contacts and the recorded torques of the",
        f"same controller, whose {1e6 * call:.1f} us are added to it.",
        "",
        "| what may touch the ground | us a step | times real time | MuJoCo [us] | ratio |",
        "|---|---|---|---|---|",
    ]
    for solids, what in ((False, "four points"), (True, "points, boxes and capsules")):
        found = times(solids)
        ours, theirs = found["pgraph"], found["mujoco"] + call
        lines.append(
            f"| {what} | {1e6 * ours:.1f} | {1e-3 / ours:.0f} | {1e6 * theirs:.1f} | "
            f"{theirs / ours:.2f} |"
        )
    return [*lines, ""]


def robustness() -> list[str]:
    return [
        "The largest disturbance with which, and with all smaller ones, the model never fell in",
        f"{SECONDS:g} s and did at least four fifths of what was asked for. Pushes act on the",
        f"pelvis for {PUSH_FOR:g} s. Kerbs: platforms of 0.8 m every 1.6 m. Rough ground: cells of",
        "25 cm, three fields, heights up to this above and below. Masses, slopes and friction are",
        "never told: the controller feels them only through the feet.",
        "`python -m benchmarks.gait_robustness` prints this table.",
        "",
        *table(),
    ]


if __name__ == "__main__":
    main()

"""Writes models, runs and targets into the case files: `python -m pgraph_models.build_cases`.

The references in the files stay as they are; what is written is what a person would have to make
of `model`, which says it in words.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.model.files import write_atomic

from . import CASES, case_models, classics

FINE = {"method": "dop853", "rtol": 1e-12}
STEPPED = {"method": "rk4", "step": 1e-3}
EPS = 2.0**-52
Entries = Iterator[dict[str, Any]]


def entry(
    model: pg.Model | str,
    *observables: dict[str, Any],
    run: dict[str, Any] | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Return a case of a file, with observables made by `seen`."""
    found: dict[str, Any] = {**more}
    if "states" not in more:
        found["run"] = FINE if run is None else run
    found["observables"] = list(observables)
    found["model"] = model if isinstance(model, str) else described(model)
    return found


def described(model: pg.Model) -> dict[str, Any]:
    """A model without what it would be anyway."""
    data = model.model_dump(mode="json", exclude_defaults=True)
    bodies = [_concise(body, row) for body, row in zip(model.bodies, data["bodies"])]
    return {"gravity": list(model.gravity), **data, "bodies": bodies}


def _concise(body: pg.Body, fields: dict[str, Any]) -> dict[str, Any]:
    """Without the fields that change nothing."""
    for key in tuple(fields):
        rest = {name: value for name, value in fields.items() if name != key}
        with suppress(pg.PgraphError):
            if key != "name" and pg.Body(**rest) == body:
                fields = rest
    return fields


def seen(kind: str, reference: Any, target: float, **given: Any) -> dict[str, Any]:
    return {"kind": kind, **given, "reference": reference, "target": target}


# -- smooth trees ----------------------------------------------------------------------------------


def a01_simple_pendulum(data: dict[str, Any]) -> Entries:
    end = {"body": "a", "point": (0, -1, 0)}
    yield entry(
        case_models.pendulum(),
        seen("point", "x", 1e-10, **end, axes="x"),
        seen("point", "y", 1e-10, **end, axes="y"),
    )


def double_pendulum(data: dict[str, Any]) -> Entries:
    yield entry(
        case_models.double_pendulum(1.0, 1.5, 2.0),
        seen("q", "theta_abs", 1e-10, absolute=True),
        seen("v", "theta_dot_abs", 1e-9, absolute=True),
        seen("vdot", "theta_ddot_at_t0", 1e-13, absolute=True, frames=[0]),
        seen("energy", "energy", 1e-13, frames=[0]),
    )


def spherical_pendulum(data: dict[str, Any]) -> Entries:
    end = {"body": "pendulum", "point": (0, 0, -1)}
    yield entry(
        classics.spherical_pendulum(height=0.0),
        *(seen("point", axis, 1e-10, **end, axes=axis) for axis in "xyz"),
        *(seen("point_velocity", "v" + axis, 1e-9, **end, axes=axis) for axis in "xyz"),
    )


def heavy_top(data: dict[str, Any]) -> Entries:
    yield entry(
        classics.heavy_top(height=0.0),
        seen("point", "com_position", 1e-8, body="top", point=(0, 1, 0)),
        seen("rotation", "quat", 1e-8, body="top"),
        seen("spin", "omega_body", 1e-8, body="top"),
        seen("energy", "energy", 1e-13, frames=[0]),
    )


def free_rigid_body_dzhanibekov(data: dict[str, Any]) -> Entries:
    yield entry(
        "../tennis_racket.json",
        seen("rotation", "R", 1e-8, body="racket"),
        seen("spin", "omega_body", 1e-8, body="racket"),
        run={"method": "dop853", "rtol": 1e-11},
    )


def chain_n_links(data: dict[str, Any]) -> Entries:
    for n, t_end, rtol, target in ((10, 1.0, 1e-12, 1e-10), (100, 1.0, 1e-12, 1e-10),
                                   (1000, 0.5, 1e-10, 1e-8)):  # fmt: skip
        quarter = 2 if n == 10 else n // 4
        places = {"tip_xy": n, "mid_xy": n // 2, "quarter_xy": quarter}
        yield entry(
            f"models/chain_{n}.json",
            *(
                seen("point", f"{n}/{name}", target, body=str(i), point=(0, -1 / n, 0), axes="xy")
                for name, i in places.items()
            ),
            run={"method": "dop853", "rtol": rtol, "t_end": t_end},
            variant=str(n),
        )


def pendulum_scales(data: dict[str, Any]) -> Entries:
    """With default tolerances, ten periods long."""
    reference = data["reference"]
    eighth = reference["theta_at_(n+1/8)T_any_n"]
    for length, period in zip(reference["L"], reference["period"]):
        rate = math.sqrt(9.81 / length)
        last = reference["theta_dot_at_T/4_times_sqrt(L/g)"] * rate
        yield entry(
            case_models.pendulum(length, m=length**3, q=math.pi / 2),
            seen("q", [eighth, 0.0, eighth, 0.0], 1e-6),
            seen("v", [last, last], 1e-6, frames=[1, 3], scale=rate),
            t=[period * x for x in (0.125, 0.25, 9.125, 9.25)],
            run={"t_end": 10 * period},
            variant=f"{length:g}",
        )


# -- extreme masses, stiffness ---------------------------------------------------------------------


def mass_ratios(ratio: float) -> Callable[[dict[str, Any]], Entries]:
    def entries(data: dict[str, Any]) -> Entries:
        reference = data["reference"]
        first = reference["theta_ddot_t0"]
        yield entry(
            case_models.double_pendulum(ratio, *reference["theta"][0]),
            seen("q", "theta", max(1e-9, 100 * EPS * ratio), absolute=True),
            seen(
                "vdot", "theta_ddot_t0", max(1e-12, 10 * EPS * ratio),
                absolute=True, frames=[0], scale=max(map(abs, first)),
            ),
            run={"method": "dop853", "rtol": 1e-7 if ratio > 1e6 else 1e-11},
        )  # fmt: skip

    return entries


def stiff_spring_pendulum(data: dict[str, Any]) -> Entries:
    """Return cases with steps too wide for the spring, from 1e8 N/m on against the limit."""
    reference = data["reference"]
    limit, slope = reference["rigid_limit_theta"], reference["slope_a_estimated_from_k1e6"]
    for k in (1e3, 1e4, 1e6, 1e8, 1e10, 1e12):
        name = f"1e{round(math.log10(k))}"
        exact = reference["undamped"].get(f"k={name}")
        theta = (
            [row[1] for row in exact["r_theta_rdot_thetadot"]]
            if exact
            else [a + b / k for a, b in zip(limit, slope)]
        )
        yield entry(
            case_models.spring_pendulum(k),
            seen("q", theta, 1e-8, bodies=["bob"], columns=[0]),
            run={"method": "radau5", "step": 1e-2},
            variant=name,
        )


# -- loops, rolling --------------------------------------------------------------------------------


def a02_n_four_bar(data: dict[str, Any]) -> Entries:
    """Flat positions cost digits, the more the nearer a step comes: 3 to 7 of them."""
    for n in (1, 2, 10, 40):
        corner = {"body": "crank 0", "point": (0, 1, 0)}
        yield entry(
            f"models/four_bar_windows_{n}.json",
            seen("point", f"{n}/x_B0", 1e-6, **corner, axes="x"),
            seen("point", f"{n}/y_B0", 1e-6, **corner, axes="y"),
            seen("drift", [0.0] * len(data["t"]), 1e-9),
            run=STEPPED,
            variant=str(n),
        )


def a04_bricard(data: dict[str, Any]) -> Entries:
    yield entry(
        "../bricard.json",
        seen("point", "P3", 1e-10, body="rod 4"),
        seen("q", "joint_angles_1_5", 1e-10),
    )


def andrews_squeezer(data: dict[str, Any]) -> Entries:
    order = ["K1", "K2", "K3", "K4", "K5", "K6", "K7"]
    yield entry(
        "../andrews.json",
        seen("q", "q", 1e-9, bodies=order),
        run={"method": "dop853", "rtol": 1e-12, "t_end": 0.03},
    )


def slider_crank_rigid(data: dict[str, Any]) -> Entries:
    yield entry(
        "../slider_crank.json",
        seen("q", "theta", 1e-9, bodies=["crank"]),
        seen("q", "slider_x", 1e-9, bodies=["slider"]),
        run={**FINE, "scenario": "turn"},
    )


def skate_on_incline(data: dict[str, Any]) -> Entries:
    places = {"axes": "x", "body": "skate"}
    yield entry(
        "../skate.json",
        seen("point", "x", 1e-10, **places),
        seen("point", "y", 1e-10, **{**places, "axes": "y"}),
        seen("drift", [0.0] * len(data["t"]), 1e-12),
    )


def rolling_disc(data: dict[str, Any]) -> Entries:
    psi, theta, _ = np.transpose(data["reference"]["psi_theta_phi"])
    axis = np.transpose((np.sin(theta) * np.sin(psi), -np.sin(theta) * np.cos(psi), np.cos(theta)))
    yield entry(
        "../rolling_disc.json",
        seen("point", "centre", 1e-10, body="disc"),
        seen("direction", axis.tolist(), 1e-10, body="disc", axis=(0, 0, 1)),
    )


# -- contact ---------------------------------------------------------------------------------------


def bouncing_ball_zeno(data: dict[str, Any]) -> Entries:
    for e, reference in data["reference"].items():
        yield entry(
            case_models.bouncing_ball(float(e)),
            seen("event_times", f"{e}/impact_times", 1e-9),
            seen("last_event", f"{e}/zeno_time", 1e-9),
            seen("contact_force", [9.81], 1e-9, contact="floor", rows=[5], frames=[-1]),
            run={"method": "rk4", "step": 2e-3, "t_end": reference["zeno_time"] + 0.1},
            grid=False,
            variant=e,
        )


def pendulum_joint_limit(data: dict[str, Any]) -> Entries:
    times = [impact["t"] for impact in data["reference"]["impacts"]]
    torque = data["reference"]["limit_torque_at_rest"]
    yield entry(
        case_models.limited_pendulum(),
        seen("event_times", times[:25], 1e-9),  # later ones are closer together than rounding
        seen("last_event", "zeno_time", 1e-9),
        seen("limit_torque", [torque], 1e-9, limit="rod low limit", frames=[-1]),
        run={**STEPPED, "t_end": 2.2},
        grid=False,
    )


def sliding_block_coulomb(data: dict[str, Any]) -> Entries:
    reference = data["reference"]
    yield entry(
        case_models.block(speed=3.0),
        seen("point", "flat/x", 1e-10, body="block", axes="x"),
        seen("point_velocity", "flat/v", 1e-10, body="block", axes="x"),
        seen("last_event", "flat/stop_time", 1e-9),
        run={"method": "rk4", "step": 1e-2},
        variant="flat",
    )
    for slope in reference["incline"]:
        angle, a = math.radians(slope["angle_deg"]), slope["acceleration"]
        speed = [-a * math.cos(angle), 0.0, -a * math.sin(angle)]
        yield entry(
            case_models.block(slope=angle),
            seen("point_velocity", [speed], 1e-9, body="block"),
            t=[1.0],
            run={"method": "rk4", "step": 1e-2},
            variant=f"{slope['angle_deg']:.4g}_degrees",
        )
    force = [reference["spring"]["final_friction_force"]]
    yield entry(
        case_models.block_on_a_spring(),
        seen("last_event", "spring/stop_time", 1e-9),
        seen("point", "spring/final_x", 1e-9, body="cart", axes="x", frames=[-1]),
        seen("contact_force", force, 1e-8, contact="floor", rows=[3], frames=[-1]),
        run={**STEPPED, "t_end": 3.0},
        grid=False,
        variant="spring",
    )


def painleve_rod(data: dict[str, Any]) -> Entries:
    """Return cases of a sliding tip on the friction cone's border, where p < 0 has no solution."""
    table = data["reference"]["table"]
    for mu in sorted({row["mu"] for row in table}):
        rows = [row for row in table if row["mu"] == mu]
        pressed = {
            "body": "rod",
            "point": (0.5, 0, 0),
            "force": (-mu, 0, 1),
            "direction": (0, 0, 1),
        }
        yield entry(
            case_models.sliding_rod(),
            seen("response", [row["p"] for row in rows], 1e-13, **pressed),
            states=[[0.0, 0.0, math.radians(row["theta_deg"])] for row in rows],
            variant=f"{mu:g}",
        )


def falling_rod_stance_to_slip(data: dict[str, Any]) -> Entries:
    for slip in data["reference"]["slip_events"]:
        t, force = slip["time_slip"], [slip["Fx_per_m"], slip["Fn_per_m"]]
        yield entry(
            classics.falling_rod(slip["mu"]),
            seen("event_times", [t], 1e-9),
            seen("q", [[slip["theta_slip"]]], 1e-9, bodies=["rod"], columns=[2], frames=[0]),
            seen("contact_force", [force], 1e-8, contact="tip", rows=[3, 5], frames=[0]),
            t=[t, t + 0.02],
            run=STEPPED,
            variant=f"{slip['mu']:g}",
        )


# -- linearised ------------------------------------------------------------------------------------


def hanging_chain_frequencies(data: dict[str, Any]) -> Entries:
    for n, reference in data["reference"].items():
        yield entry(
            f"models/chain_{n}.json",
            seen(
                "frequencies", f"{n}/omega_rad_s(total length 1)", 1e-11,
                modes=reference["mode_index"], scale=1e-9,
            ),
            states=[[0.0] * int(n)],
            variant=n,
        )  # fmt: skip


BUILDERS: tuple[Callable[[dict[str, Any]], Entries], ...] = (
    a01_simple_pendulum, double_pendulum, spherical_pendulum, heavy_top,
    free_rigid_body_dzhanibekov, chain_n_links, pendulum_scales, stiff_spring_pendulum,
    a02_n_four_bar, a04_bricard, andrews_squeezer, slider_crank_rigid, skate_on_incline,
    rolling_disc, bouncing_ball_zeno, pendulum_joint_limit, sliding_block_coulomb, painleve_rod,
    falling_rod_stance_to_slip, hanging_chain_frequencies,
)  # fmt: skip
FILES = {builder.__name__: builder for builder in BUILDERS} | {
    "mass_ratio_heavy_tip_1e3": mass_ratios(1e3),
    "mass_ratio_heavy_tip_1e9": mass_ratios(1e9),
    "mass_ratio_light_tip_1em6": mass_ratios(1e-6),
    "mass_ratio_light_tip_1em12": mass_ratios(1e-12),
}
MODELS = {
    **{f"chain_{n}": (case_models.chain, n) for n in (1, 2, 10, 100, 1000)},
    **{f"four_bar_windows_{n}": (classics.four_bar_windows, n) for n in (1, 2, 10, 40)},
}


def text(data: dict[str, Any]) -> str:
    """JSON with one number series, one observable, one body a line."""
    return _laid_out(data, 0) + "\n"


def _laid_out(value: Any, depth: int) -> str:
    flat = json.dumps(value)
    if len(flat) < 100 or not isinstance(value, (dict, list)):
        return flat
    if isinstance(value, list) and not isinstance(value[0], dict):
        return flat
    inner = "\n" + "  " * (depth + 1)
    if isinstance(value, list):
        case = "model" in value[0]
        parts = [_laid_out(item, depth + 1) if case else json.dumps(item) for item in value]
        return "[" + inner + ("," + inner).join(parts) + "\n" + "  " * depth + "]"
    pairs = [f"{json.dumps(k)}: {_laid_out(v, depth + 1)}" for k, v in value.items()]
    return "{" + inner + ("," + inner).join(pairs) + "\n" + "  " * depth + "}"


def write(folder: Path = CASES) -> None:
    """Rewrite the `cases` of every file and the models that several share."""
    (folder / "models").mkdir(exist_ok=True)
    for name, (builder, n) in MODELS.items():
        write_atomic(folder / "models" / f"{name}.json", text(described(builder(n))))
    for name, builder in FILES.items():
        data = json.loads((CASES / f"{name}.json").read_text(encoding="utf-8"))
        data["cases"] = list(builder(data))
        write_atomic(folder / f"{name}.json", text(data))


if __name__ == "__main__":
    write()

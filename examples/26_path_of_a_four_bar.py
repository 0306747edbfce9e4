"""A four-bar whose coupler point follows a path: `pg.optimise` finds its lengths.

The path is that of a known four-bar, so that the answer can be checked. Five starts find it.
"""

from typing import Any

import pgraph_core as pg

BODY: dict[str, Any] = {
    "joint": "revolute",
    "axes": [(0, 0, 1)],
    "mass": 1.0,
    "inertia": (0.1, 0.1, 0.1),
}
FREE = {  # path, and the number of the four-bar that drew the path [m]
    "bodies.coupler.link.0": 0.5,  # the crank
    "constraints.pin.point.0": 2.0,  # the coupler
    "constraints.pin.other_point.0": 1.6,  # the rocker
    "sites.pen.point.0": 1.0,
    "sites.pen.point.1": 0.6,
}


def four_bar(crank: float, coupler: float, rocker: float, *pen: float) -> pg.Model:
    """A crank that turns once in a second, and a pen on the coupler."""
    bodies = [
        pg.Body(name="crank", q=[0.0], **BODY),
        pg.Body(name="coupler", parent="crank", link=(crank, 0, 0), q=[0.8], **BODY),
        pg.Body(name="rocker", link=(2.2, 0, 0), q=[1.8], **BODY),
    ]
    pin = pg.Point(name="pin", body="coupler", other="rocker",
                   point=(coupler, 0, 0), other_point=(rocker, 0, 0))  # fmt: skip
    turn = pg.Motion(name="turn", body="crank", q_of_t="=2*pi*t")
    site = pg.Site(name="pen", body="coupler", point=(*pen, 0))
    drawn = pg.Output(name="drawn", kind="position", at="pen")
    return pg.Model(bodies=bodies, constraints=[pin, turn], sites=[site], outputs=[drawn])


options: dict[str, Any] = {"t_end": 1.0, "method": "rk4", "step": 0.01, "frames": 41}
path = pg.simulate(four_bar(*FREE.values()), **options).outputs["drawn"]
guess = four_bar(*(0.9 * length for length in FREE.values()))
free = {name: (0.75 * length, 1.25 * length) for name, length in FREE.items()}
found = pg.optimise(guess, lambda run: run.outputs["drawn"] - path, free, starts=5, **options)
print(found)
missed = [max(abs(end.values[name] - FREE[name]) for name in FREE) for end in found.endings]
print("largest error of a length, by start [m]:", *(f"{miss:.1e}" for miss in missed))
print(f"all starts find the four-bar that drew the path: {max(missed) < 1e-5}")

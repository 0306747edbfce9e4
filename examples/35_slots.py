"""Turn a crank in a slot, lift a car window along its rails, and follow a groove: curves."""

import math

import numpy as np

import pgraph_core as pg

# a window slides on two bent rails of the door, lifted by an arm whose pin runs in its slot
radius, lowest = 1.2, 0.25  # the rails are arcs, which lean where the window is closed


def rail(x: float) -> list[list[float]]:
    """Return points of a rail that is at x on the lower edge of the door."""
    angles = np.linspace(lowest - 0.1, lowest + 0.4, 9)
    arc = np.column_stack((np.cos(angles), 0 * angles, np.sin(angles)))
    start = np.array((math.cos(lowest), 0, math.sin(lowest)))
    return (radius * (arc - start) + (x, 0, 0)).tolist()


flat = [("translate", (1, 0, 0)), ("translate", (0, 0, 1)), ("rotate", (0, 1, 0))]
window = pg.Body(name="window", joint="compound", motions=flat, mass=4, inertia=(0.2, 0.3, 0.2))
arm = pg.Body(name="arm", axes=[(0, 1, 0)], link=(0.0, 0, -0.15), mass=0.5, com=(0.2, 0, 0),
              inertia=(0.001, 0.01, 0.01), q=(0.25,))  # fmt: skip
ties = [
    pg.CurvePoint(name="front", body="window", point=(-0.3, 0, 0), curve=rail(-0.3)),
    pg.CurvePoint(name="rear", body="window", point=(0.3, 0, 0), curve=rail(0.3)),
    pg.CurvePoint(name="slot", body="arm", point=(0.35, 0, 0), other="window",
                  curve=[(0.1, 0, -0.24), (0.6, 0, -0.24)]),
    pg.Motion(name="winder", body="arm", q_of_t="=0.25 - 0.9*smoothstep(t, 0, 3)"),
]  # fmt: skip
door = pg.Model(bodies=[window, arm], constraints=ties)
run = pg.simulate(door, t_end=3, rtol=1e-9)
place = run.body_pose["window"]
print(f"the window rises by {place[-1, 2] - place[0, 2]:.3f} m")
torque = run.constraint_force["winder"][:, 1]
print(f"the winder needs up to {np.abs(torque).max():.2f} N m")
free = pg.Mechanism(door.remove("winder")).mobility()
print(f"degrees of freedom without the winder: {free.dof}")

# a follower in a closed groove of a disc, which it passes many times
angle = np.linspace(0, 2 * math.pi, 24, endpoint=False)
size = 0.1 + 0.02 * np.cos(2 * angle)
groove = np.column_stack((size * np.cos(angle), 0 * angle, size * np.sin(angle)))
disc = pg.Body(name="disc", axes=[(0, 1, 0)], inertia=(0.01, 0.01, 0.01), v=(20,))
slide = pg.Body(name="slide", joint="prismatic", axes=[(0, 0, 1)], mass=0.5, q=(size[6],))
closed = {"points": groove, "closed": True}
pin = pg.CurvePoint(name="pin", body="slide", point=(0, 0, 0), other="disc", curve=closed)
run = pg.simulate(pg.Model(bodies=[disc, slide], constraints=[pin]), t_end=3, rtol=1e-10)
print(f"the slide moves between {run.q[:, 1].min():.4f} and {run.q[:, 1].max():.4f} m")
print(f"energy is kept: {run.energy_drift < 1e-6}")

"""Turn a Geneva wheel by the contact of a pin with the walls of its slots."""

import numpy as np

import pgraph_core as pg

SLOTS, ARM, PIN, PLAY = 4, 0.05, 0.004, 1e-4  # number, crank [m], radius of the pin, play [m]
APART = ARM / np.sin(np.pi / SLOTS)  # distance of the axes: the pin enters along a slot [m]
DEEP, RIM, WALL = APART - ARM - 2 * PIN, APART * np.cos(np.pi / SLOTS), 0.006  # [m]

walls = []
for angle in 2 * np.pi * (np.arange(SLOTS) + 0.5) / SLOTS:  # the pin starts between two slots
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    for side in (1, -1):
        x, y = (DEEP + RIM) / 2 * along + side * (PIN + PLAY / 2 + WALL / 2) * across
        turn = (np.cos(angle / 2), 0, 0, np.sin(angle / 2))
        size = (RIM - DEEP, WALL, 0.01)
        walls.append(pg.Shape(kind="box", size=size, position=(x, y, 0), rotation=turn))

pin = pg.Shape(kind="cylinder", radius=PIN, length=0.02, position=(ARM, 0, 0))
crank = pg.Body(name="crank", axes=(0, 0, 1), mass=0.1, inertia=(1e-4,) * 3, shape=pin, q=(np.pi,))
wheel = pg.Body(
    name="wheel", link=(APART, 0, 0), axes=(0, 0, 1), mass=0.2, inertia=(1e-4,) * 3, shapes=walls,
    friction=0.002,  # holds the wheel between two steps [N m]
)  # fmt: skip
model = pg.Model(
    bodies=[crank, wheel],
    gravity=(0, 0, 0),
    contacts=[pg.Contact(name="pin", body="crank", other="wheel", friction=0.1)],
    constraints=[pg.Motion(name="drive", body="crank", q_of_t=f"={np.pi} + {2 * np.pi}*t")],
)
run = pg.simulate(model, t_end=2, step=5e-4)
print(f"the wheel turns by {np.degrees(run['wheel'][-1]):.2f} degrees in two turns of the crank")

# while the pin is in a slot, the wheel follows it within the play
angle = (run["crank"] + np.pi) % (2 * np.pi) - np.pi
inside = (np.abs(angle) < np.pi / 2 - np.pi / SLOTS - 0.02) & (run.t < 1)
exact = -np.arctan2(ARM * np.sin(angle), APART - ARM * np.cos(angle)) - np.pi / SLOTS
off = np.abs(run["wheel"] - exact)[inside].max()
print(f"beside the closed form: {np.degrees(off):.3f} degrees")
print(f"no more than the play allows: {off < 1.2 * PLAY / 2 / (APART - ARM)}")
print(f"a slot per turn: {abs(run['wheel'][-1] + 2 * 2 * np.pi / SLOTS) < 0.01}")

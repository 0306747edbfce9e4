"""Let a bead slide on a wire, and bend a knee whose axis moves: joints that follow a track."""

import math

import numpy as np

import pgraph_core as pg

# a cycloid: a bead comes to the bottom after the same time, wherever it starts
cycloid = pg.Track(x="q-sin(q)", z="cos(q)", range=(0.2, 6.0))
quarter = math.pi / math.sqrt(9.81)
for start in (0.5, 1.5, 2.5):
    bead = pg.Body(name="bead", joint="curve", track=cycloid, mass=0.1, q=start)
    run = pg.simulate(pg.Model(bodies=[bead]), t_end=quarter, rtol=1e-10)
    there = abs(run.q[-1, 0] - math.pi) < 1e-5
    print(f"from q = {start}, the bead is at the bottom after {quarter:.3f} s: {there}")

# a curve through points, closed, along which a wagon turns
corners = [(4, 0, 1), (3, 3, 0.5), (0, 4, 1), (-3, 3, 2), (-4, 0, 1.5), (0, -4, 0.5)]
track = pg.Track(points=corners, closed=True, up=(0, 0, 1))
box = {"kind": "box", "size": (0.6, 0.3, 0.2)}
wagon = pg.Body(name="wagon", joint="curve", track=track, mass=50, v=6.0, shape=box)
run = pg.simulate(pg.Model(bodies=[wagon]), t_end=10.0)
print(
    f"the wagon goes {run.q[-1, 0]:.3f} m; its speed is {run.v.min():.2f} to {run.v.max():.2f} m/s"
)

# a knee that rolls and slides while it bends
angle = np.linspace(0.0, 2.0, 9)
roll = list(zip(angle.tolist(), (0.004 * np.sin(angle)).tolist()))
drop = list(zip(angle.tolist(), (-0.006 * angle**2).tolist()))
knee = pg.Track(angles=["-q"], axes=[(0, 1, 0)], x=roll, z=drop)
thigh = pg.Body(name="thigh", axes=(0, 1, 0), com=(0, 0, -0.2), mass=8, q=-0.5)
shank = pg.Body(
    name="shank", parent="thigh", joint="curve", track=knee, link=(0, 0, -0.4),
    com=(0, 0, -0.2), mass=3, q=0.8, stiffness=30.0, rest=1.0, damping=0.2,
)  # fmt: skip
run = pg.simulate(pg.Model(bodies=[thigh, shank]), t_end=1.0)
print(f"the knee stays within its track: {0.0 < run.q[:, 1].min() < run.q[:, 1].max() < 2.0}")

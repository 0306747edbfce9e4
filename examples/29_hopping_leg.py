"""Let a leg hop: a sampled control is a state machine of flight, compression and thrust."""

from itertools import pairwise

import numpy as np

import pgraph_core as pg

slide = {"joint": "prismatic", "axes": [(0, 0, 1)]}
hip = pg.Body(name="hip", **slide, mass=5.0, q=[0.8])
foot = pg.Body(
    name="foot", parent="hip", **slide, link=(0, 0, -0.5), mass=0.2,
    shape=pg.Shape(kind="sphere", radius=0.03),
)  # fmt: skip
FLIGHT, COMPRESSION, THRUST = 0, 1, 2
phase = pg.Sampled(
    name="phase", sample=2e-3,
    update="=if(x.phase < 0.5, if(q.foot > 0.01, 1, 0), "
    "if(x.phase < 1.5, if(v.hip > 0, 2, 1), if(q.foot < 0, 0, 2)))",
)  # fmt: skip
leg = pg.Servo(name="leg", body="foot", kp=3000.0, kd=25.0, target="=if(x.phase > 1.5, -0.05, 0)")
model = pg.Model(
    bodies=[hip, foot], forces=[leg], controls=[phase],
    contacts=[pg.Contact(name="sole", body="foot")],
)  # fmt: skip
run = pg.simulate(model, t_end=4.0, step=1e-3)
height, phases = run["hip"], run.controls["phase"]
turns = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
print("heights of the hops:", np.round(height[turns], 3), "m")
steps = {(int(a), int(b)) for a, b in pairwise(phases) if a != b}
print(f"phases follow each other in a ring: {steps == {(0, 1), (1, 2), (2, 0)}}")
print(f"it goes on hopping: {len(turns) > 3 and height[turns[-1]] > 0.56}")

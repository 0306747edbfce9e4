"""Lift a follower by a cam with dwells, and turn a wheel by an elliptic gear: relations."""

import math

import numpy as np

import pgraph_core as pg

# a cam at 300 rpm: up by 20 mm within 90 degrees, there for 90 degrees, and down again
h, beta, speed = 0.02, math.pi / 2, 300 * 2 * math.pi / 60
rise = pg.Curve(x=(0, beta), value=(0, h), kind="quintic")  # the 3-4-5 polynomial
cam = pg.Body(name="cam", axes=[(0, 1, 0)], inertia=(0.02, 0.02, 0.02))
follower = pg.Body(name="follower", joint="prismatic", axes=[(0, 0, 1)], mass=0.5)
lift = pg.Relation(name="lift", body="follower", other="cam", curve=rise)
drive = pg.Motion(name="drive", body="cam", q_of_t=pg.Polynomial(coefficients=(0.0, speed)))
model = pg.Model(bodies=[cam, follower], constraints=[lift, drive])
run = pg.simulate(model, t_end=2 * beta / speed, frames=1001)
peak = 10 / math.sqrt(3) * h / beta**2 * speed**2
print(f"the follower is up at {1e3 * run.q[-1, 1]:.3f} mm")
print(f"its largest acceleration is {run.vdot[:, 1].max():.1f} m/s², and {peak:.1f} in theory")
force = run.constraint_force["lift"][:, 5]
print(f"a spring must press with {-force.min():.1f} N, or the follower lifts off")

# two equal ellipses that turn about their foci
e = 0.4
wheels = [pg.Body(name=name, inertia=(0.1, 0.1, 0.1)) for name in ("first", "second")]
turned = f"=q + 2*atan({e}*sin(q)/(1 - {e}*cos(q)))"
gear = pg.Relation(name="gear", body="second", other="first", curve=turned)
start = pg.Model(bodies=wheels, constraints=[gear]).edit("first", v=1.0)
run = pg.simulate(start, t_end=20.0, rtol=1e-10)
angle, (one, two) = run.q[:, 0], run.v.T
known = (1 - e**2) / (1 + e**2 - 2 * e * np.cos(angle))
print(f"the ratio of speeds is that of the radii: {np.abs(two / one - known).max() < 1e-9}")

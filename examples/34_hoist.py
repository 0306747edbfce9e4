"""Lift a load by a winch and a tackle, drive a wheel by a belt, and catch a slack rope."""

import numpy as np

import pgraph_core as pg

UP, ACROSS = (0, 0, 1), (0, 1, 0)

# a winch lifts a block on four strands: its motor does the work
drum = pg.Body(name="drum", axes=[ACROSS], link=(0.7, 0, -2), mass=5, inertia=(0.03, 0.05, 0.03))
block = pg.Body(name="block", joint="prismatic", axes=[UP], link=(0, 0, -2), mass=200)
stations = [pg.Pulley(body="ground", point=(-0.1, 0, 0))]
for x in (0.0, 0.4):
    stations.append(pg.Pulley(body="block", point=(x, 0, 0), radius=0.1, axis=ACROSS))
    stations.append(pg.Pulley(body="ground", point=(x + 0.2, 0, 0), radius=0.1, axis=ACROSS))
rope = pg.Rope(name="rope", through=[*stations, pg.Pulley(body="drum", radius=0.08, side=1)])
motor = pg.Motor(name="motor", body="drum", torque=40.5)
crane = pg.Model(bodies=[drum, block], constraints=[rope], forces=[motor])
run = pg.simulate(crane, t_end=3)
lifted, turns = run.q[-1, 1] - run.q[0, 1], abs(run.q[-1, 0]) / (2 * np.pi)
print(f"the block rises by {lifted:.3f} m in {turns:.2f} turns of the drum")
pull = run.tension["rope"][-1]
print(f"tension of the rope: {pull:.1f} N, a quarter of {200 * 9.81:.0f} N and of m a")
balance = run.energy[-1] - run.energy[0] - run.work[-1]
print(f"the energy is the work of the motor: {abs(balance) < 1e-10 * run.work[-1]}")

# an elastic belt with a pretension drives a flywheel at a third of the speed
pinion = pg.Body(name="pinion", axes=[ACROSS], mass=1, inertia=(1e-3, 2e-3, 1e-3))
flywheel = pg.Body(name="flywheel", axes=[ACROSS], link=(0.5, 0, 0), mass=9, inertia=(0.1,) * 3)
belt = pg.belt(["pinion", "flywheel"], radii=(0.05, 0.15), stiffness=4e4, damping=40, tension=120)
start = pg.Motor(name="start", body="pinion", torque={"t": [0, 0.2], "value": [0, 3]})
drive = pg.Model(bodies=[pinion, flywheel], forces=[belt, start])
run = pg.simulate(drive, t_end=2)
ratio = run.v[-1, 0] / run.v[-1, 1]
tight, loose = (run.tension[f"belt[{k}]"][-1] for k in (1, 2))
print(f"speeds {ratio:.3f}:1, tensions {tight:.0f} and {loose:.0f} N")

# a weight is thrown up: its rope slackens, and becomes taut by a jerk
wheel = pg.Pulley(body="ground", radius=0.1, axis=ACROSS)
left = pg.Body(name="left", joint="prismatic", axes=[UP], link=(-0.1, 0, -1), mass=3)
right = pg.Body(name="right", joint="prismatic", axes=[UP], link=(0.1, 0, -1.5), mass=1, v=(2,))
slack = pg.Cable(name="rope", through=["left", wheel, "right"])
run = pg.simulate(pg.Model(bodies=[left, right], forces=[slack]), t_end=0.6)
lost = run.energy[0] - run.energy[-1]
print(f"the jerk loses {lost:.3f} J; both move at {abs(run.v[-1, 0]):.3f} m/s")

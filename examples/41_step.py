"""Read a CAD assembly from a STEP file, accept its proposed joints, and drive the crank."""

from pathlib import Path

import numpy as np

import pgraph_core as pg

FILE = Path(__file__).with_name("four_bar.step")  # lengths 30, 100, 80 and 90 mm

# no joint is taken unless it is accepted; each proposal says what speaks for it
steel = {"*": 7850.0, "coupler": 2700.0}  # [kg/m^3]
model, report = pg.read_step(FILE, density=steel, joints="accept")
for joint in report.joints:
    print(joint)
print(f"degrees of freedom: {pg.Mechanism(model).mobility().dof}")

# the crank turns once a second, and its motion is a constraint with the torque as its force
turning = pg.Motion(name="turning", body="crank", q_of_t="=2*pi*t")
run = pg.simulate(model.add(turning), t_end=1, rtol=1e-8)
swing = np.degrees(np.ptp(run["rocker"]))
print(f"the rocker swings by {swing:.2f} degrees")

# beside closed forms: the two stretched positions of crank and coupler, and the coupler's solid
crank, coupler, rocker, ground = 0.03, 0.1, 0.08, 0.09
ends = [
    np.arccos((ground**2 + rocker**2 - reach**2) / (2 * ground * rocker))
    for reach in (coupler + crank, coupler - crank)
]
print(f"as by geometry: {abs(swing - np.degrees(ends[0] - ends[1])) < 0.01}")
mass = steel["coupler"] * 0.116 * 0.016 * 0.008  # the pin has the size of the bore
print(f"the mass is that of the solid: {abs(model.body('coupler').mass / mass - 1) < 1e-9}")

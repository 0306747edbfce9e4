"""Compare three followers of a cam: pressure angle, force, and the least base radius."""

import math

import numpy as np

import pgraph_core as pg

turn = [
    pg.CamSegment(lift=0.02, angle=math.radians(90), law="cycloidal"),
    pg.CamSegment(lift=0.02, angle=math.radians(60)),
    pg.CamSegment(lift=0.0, angle=math.radians(110), law="4-5-6-7"),
    pg.CamSegment(lift=0.0),
]
shaft = pg.Body(name="shaft", axes=[(0, 1, 0)], inertia=(0.02, 0.02, 0.02))
valve = pg.Body(name="valve", joint="prismatic", axes=[(0, 0, 1)], mass=0.5)
drive = pg.Motion(name="drive", body="shaft", q_of_t="=10*pi*t")  # 300 rpm
press = pg.Motor(name="press", body="valve", torque="=-60 - 2000*q.valve")  # a spring

knife = pg.Cam(name="lift", body="valve", other="shaft", motion=turn, base_radius=0.04)
roller = pg.Cam(name="lift", body="valve", other="shaft", motion=turn, base_radius=0.04,
                follower="roller", roller_radius=0.01, eccentricity=0.008)  # fmt: skip
flat = pg.Cam(name="lift", body="valve", other="shaft", motion=turn, base_radius=0.06,
              follower="flat")  # fmt: skip
for lift in (knife, roller, flat):
    model = pg.Model(bodies=[shaft, valve], constraints=[lift, drive], forces=[press])
    run = pg.simulate(model, t_end=0.2, frames=721)
    angle = math.degrees(np.abs(run["pressure_angle.lift"]).max())
    force = run["normal_force.lift"]
    print(f"{lift.follower}: at most {angle:.1f} degrees, {force.min():.0f} to {force.max():.0f} N")
    print(f"  it stays on the cam: {force.min() > 0}")
    radius = np.linalg.norm(lift.profile(), axis=1)
    print(f"  its profile is from {1e3 * radius.min():.1f} to {1e3 * radius.max():.1f} mm")
    guide = np.abs(run.joint_force["valve"][:, 3]).max()
    print(f"  and the guide of the valve carries up to {guide:.0f} N")

try:
    pg.Cam(name="lift", body="valve", other="shaft", motion=turn, follower="flat", base_radius=0.03)
except pg.ModelError as error:
    print(error)

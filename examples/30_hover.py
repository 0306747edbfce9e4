"""Hover with a quadcopter: position controllers give the attitude that others hold."""

import numpy as np

import pgraph_core as pg

X, Y, Z = np.eye(3)
drone = pg.Body(
    name="drone", joint="compound", mass=1.2, inertia=(0.01, 0.01, 0.02),
    motions=[("translate", X), ("translate", Y), ("translate", Z),
             ("rotate", Z), ("rotate", Y), ("rotate", X)],
)  # fmt: skip
WEIGHT = 1.2 * 9.81


def pid(name, signal, setpoint, **gains):
    return pg.PID(name=name, signal=signal, setpoint=setpoint, filter=0.02, **gains)


controls = [
    pid("lift", "=q.drone[2]", 1.0, kp=12.0, ki=6.0, kd=8.0, low=0.0, high=25.0, start=WEIGHT),
    pid("forward", "=q.drone[0]", 0.5, kp=0.25, kd=0.3, low=-0.3, high=0.3),
    pid("left", "=q.drone[1]", -0.5, kp=0.25, kd=0.3, low=-0.3, high=0.3),
    pid("pitch", "=q.drone[4]", "=x.forward", kp=1.5, kd=0.25),
    pid("roll", "=q.drone[5]", "=-x.left", kp=1.5, kd=0.25),
    pid("yaw", "=q.drone[3]", 0.0, kp=0.5, kd=0.2),
]
rotors = pg.Wrench(
    name="rotors", body="drone", frame="body",
    force=[0, 0, "=x.lift"], torque=["=x.roll", "=x.pitch", "=x.yaw"],
)  # fmt: skip
run = pg.simulate(
    pg.Model(bodies=[drone], forces=[rotors], controls=controls),
    t_end=12.0, q=[0, 0, 0, 0.4, 0.1, -0.1],
)  # fmt: skip
print("it hovers at", np.round(run.q[-1, :3], 3) + 0.0, "m")
print(f"at its place: {np.allclose(run.q[-1], [0.5, -0.5, 1, 0, 0, 0], atol=5e-3)}")
print(f"it never tilts by more than 0.5 rad: {np.abs(run.q[:, 4:]).max() < 0.5}")

"""Drive a load through a flexible shaft with a PID controller whose torque is limited."""

import pgraph_core as pg

axis = {"joint": "revolute", "axes": [(0, 0, 1)]}
motor = pg.Body(name="motor", **axis, mass=1.0, inertia=(1e-3, 1e-3, 1e-3))
load = pg.Body(name="load", **axis, mass=5.0, inertia=(2e-2, 2e-2, 2e-2))
shaft = pg.Tendon(
    name="shaft", coefficients={"motor": 1.0, "load": -1.0}, stiffness=30.0, damping=0.02
)


def run(windup, **more):
    speed = pg.PID(
        name="speed", signal="=v.motor", setpoint="=if(t < 0.1, 0, 20)", kp=0.05, ki=0.6,
        low=-0.5, high=0.5, windup=windup, **more,
    )  # fmt: skip
    drive = pg.Motor(name="drive", body="motor", torque="=x.speed")
    model = pg.Model(bodies=[motor, load], forces=[shaft, drive], controls=[speed])
    return pg.simulate(model, t_end=6.0)


plain, clamped = run("none"), run("clamp")
overshoot = [float(r["v.load"].max()) - 20.0 for r in (plain, clamped)]
print(f"beyond the setpoint: {overshoot[0]:.2f} rad/s, {overshoot[1]:.2f} with anti-windup")
print(f"the torque stays within its limits: {abs(clamped.controls['speed']).max() <= 0.5}")
print(f"anti-windup halves the overshoot: {overshoot[1] < 0.5 * overshoot[0]}")

"""A pendulum with controls, for their tests."""

import pgraph_core as pg

Z = (0, 0, 1)


def pendulum(controls=(), torque: float | str = 0.0, **fields):
    arm = pg.Body(name="arm", axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2))
    drive = [pg.Motor(name="drive", body="arm", torque=torque)]
    return pg.Model(
        bodies=[arm], gravity=(0, -9.81, 0), forces=drive, controls=list(controls),
        parameters={"k": 5.0}, **fields,
    )  # fmt: skip


STATES = (
    pg.State(name="i", rate="=1 - q.arm - 0.2*x.i", start=0.3),
    pg.Filter(name="f", input="=v.arm", lag=0.1),
)


TORQUE = "=k*x.i - 2*x.f"


EVERY = (
    *STATES,
    pg.PID(
        name="pid",
        signal="=q.arm",
        setpoint="=x.i",
        kp=4.0,
        ki=3.0,
        low=-2.0,
        high=2.0,
        windup="back",
        tracking=0.2,
    ),
    pg.Sampled(name="u", update="=-3*q.arm + 0.2*x.u", sample=0.05),
)


WHOLE = "=k*x.i - 2*x.f + x.pid + x.u"

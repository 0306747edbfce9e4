"""A program of a user, for the strict type checker of `make check`: no test runs it.

What is right passes. What is wrong must be found: an `ignore` that nothing needs is an error.
"""

# pyright: strict, reportUnnecessaryTypeIgnoreComment=true

import numpy as np

import pgraph_core as pg

body = pg.Body(
    name="a", axes=(0, 1, 0), inertia=np.eye(3), limits=[-1, 1], dof=1,
    shape={"kind": "sphere", "radius": 1},
)  # fmt: skip
rod = pg.Body(
    name="b", parent="a", joint="compound", motions=[("rotate", (0, 0, 1))], com=np.zeros(3),
    q=[0.1], damping=0.1, shapes=[{"kind": "box", "size": np.ones(3)}], derived=["com"],
)  # fmt: skip
motor = pg.Motor(name="m2", body="a", torque={"t": [0, 1], "value": [0, 1]})
model = pg.Model(
    bodies=[body, rod],
    forces=[pg.Spring(name="s", body="a", point=(0, 0, 1)), {"name": "m", "body": "a"}],
    constraints=(pg.Gear(name="g", body="a", other="b", ratio=2),),
    contacts=[pg.Contact(name="c", body="a", points=[(0, 0, 0)])],
    scenarios=[pg.Scenario(name="s", q={"a": 0.1}, v={"b": [1]}, t_end=2, forces=[motor])],
    parameters={"k": 2}, gravity=(0, 0, -9.81), ground={"friction": 0.3},
)  # fmt: skip
m2 = model.add(pg.Wrench(name="w", body="a", force=(0, 0, 1)))
m2 = m2.edit("w", force=(0, 0, 2)).remove("w")
spring = model.part("s", "force")
if isinstance(spring, pg.Spring):
    k: float | str = spring.stiffness
    print(k, spring.rest)
print(pg.Table(t=[0, 1], value=np.zeros(2)), model.body("a").axes[0], m2)
print(body.mass, pg.simulate(pg.Model(bodies=[body]), t_end=1.0).q[-1])


def wrong() -> None:
    pg.Spring(name="s", body="a", stifness=1)  # pyright: ignore[reportCallIssue]
    pg.Body(name="a", mass="heavy")  # pyright: ignore[reportArgumentType]
    pg.Spring(name="s", body="a", kp=1)  # pyright: ignore[reportCallIssue]

"""Add a spring and a contact: a block that hangs on a spring and lands on the floor.

Run it with `python examples/19_spring_and_contact.py`.
"""

import numpy as np

import pgraph_core as pg

size = (0.2, 0.2, 0.2)
block = pg.Body(name="block", joint="free", mass=2.0, inertia=0.013 * np.eye(3), link=(0, 0, 0.5),
                shape={"kind": "box", "size": size})  # fmt: skip
model = pg.Model(bodies=[block])
model = model.add(pg.Spring(name="spring", body="block", other_point=(0, 0, 1.5), stiffness=8.0))
model = model.add(pg.Contact(name="floor", body="block", friction=0.4, restitution=0.3))

run = pg.simulate(model, t_end=3.0)
weight, floor = 2.0 * 9.81, run.contact_force["floor"][-1, 5]
print(f"the floor carries {floor:.2f} N of {weight:.2f} N, the spring the rest")
print("at rest:", abs(run.v[-1]).max() < 1e-6)

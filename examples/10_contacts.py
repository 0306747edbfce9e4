"""Contacts: a ball that bounces, a box on a slope, and what the ground does to them.

Run it with `python examples/10_contacts.py`.
"""

import numpy as np

import pgraph_core as pg

ball = pg.Body(name="ball", joint="free", link=(0, 0, 1.1), shape={"kind": "sphere", "radius": 0.1})
floor = pg.Contact(name="floor", body="ball", restitution=0.5)
run = pg.simulate(pg.Mechanism(pg.Model(bodies=(ball,), contacts=(floor,))), t_end=2.0)
print("method:", run.header["why"])
force, gap = run.contact_force["floor"][-1, 5], run.contact_gap["floor"][-1]
print(f"ball at rest on {force:.4f} N, gap {gap:.1e} m")

for degrees in (16, 17):
    box = pg.Body(
        name="box", joint="free", link=(0, 0, 0.1), shape={"kind": "box", "size": (0.2, 0.2, 0.2)}
    )
    angle = np.radians(degrees)
    model = pg.Model(
        bodies=(box,),
        gravity=(9.81 * np.sin(angle), 0, -9.81 * np.cos(angle)),
        contacts=(pg.Contact(name="rough", body="box", friction=0.3),),
    )
    run = pg.simulate(pg.Mechanism(model), t_end=1.0)
    print(f"box on {degrees} degrees: {run.v[-1, 3]:.3f} m/s after a second")

"""Feedback as part of the model: a pole balances on a cart, and the gain is a parameter."""

import pgraph_core as pg

cart = pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
pole = pg.Body(
    name="pole", parent="cart", joint="revolute", axes=[(0, 0, 1)], mass=0.2, com=(0, 0.5, 0),
    inertia=(0.017, 0.001, 0.017), q=[0.2],
)  # fmt: skip
push = pg.Motor(
    name="push",
    body="cart",
    torque="=k*q.cart + 3*v.cart - 40*q.pole - 8*v.pole",
    torque_limit=20.0,
)
model = pg.Model(bodies=[cart, pole], gravity=(0, -9.81, 0), forces=[push], parameters={"k": 1.5})

run = pg.simulate(model, t_end=8.0)
print(f"the pole is upright after 8 s: {abs(run.q[-1, 1]) < 1e-3}")

final = {"lean": lambda run: abs(float(run.q[-1, 1]))}
table = pg.sweep(model, {"k": [0.5, 1.5, 4.0]}, final, t_end=8.0)
for k, lean in zip((0.5, 1.5, 4.0), table["lean"], strict=True):
    print(f"k = {k}: {lean:.4f} rad")

"""Hand a cart with a pole over to other programs: an FMU, and a C library with an example."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pgraph_core as pg

rod = pg.Shape(kind="box", size=(0.02, 0.02, 1.0), position=(0, 0, 0.5))
cart = pg.Body(name="cart", joint="prismatic", axes=(1, 0, 0), mass=2.0)
pole = pg.Body(
    name="pole", parent="cart", axes=(0, 1, 0), mass=0.3, shape=rod, derived=("com", "inertia"),
    q=0.1,
)  # fmt: skip
push = pg.Motor(name="push", body="cart", torque=0.5)
tip = pg.Output(name="tip", kind="position", at="pole")
model = pg.Model(name="cart pole", bodies=[cart, pole], forces=[push], outputs=[tip])

with TemporaryDirectory() as folder:
    report = pg.write_fmu(model, f"{folder}/cart_pole.fmu", parameters=["bodies.pole.mass"])
    print(report)
    pg.write_c(model, f"{folder}/c")
    done = subprocess.run(  # -S: without any installed package
        [sys.executable, "-S", "example.py"], cwd=Path(folder, "c"),
        capture_output=True, text=True, check=True,
    )  # fmt: skip
names, *_, last = (line.split(",") for line in done.stdout.splitlines())
found = dict(zip(names, map(float, last)))
run = pg.simulate(model, t_end=1.0, step=1e-3, method="rk4", estimate=False)
print(f"the C library ends in the same bits: {found['pole'] == run['pole'][-1]}")

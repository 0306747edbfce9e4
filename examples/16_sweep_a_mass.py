"""Sweep a mass and plot: how high the lower rod of a double pendulum swings.

Run it with `python examples/16_sweep_a_mass.py`; it needs `pip install 'pgraph-dynamics[plot]'`.
"""

# pyright: reportUnknownMemberType=false
# ... because matplotlib types its keyword arguments only in part.

import matplotlib.pyplot as plt
import numpy as np

import pgraph_core as pg
import pgraph_models

model = pg.Model.load(pgraph_models.path("double_pendulum"))
masses = np.linspace(0.5, 4.0, 8)
runs = [pg.simulate(model.edit("lower", mass=mass), t_end=2.0) for mass in masses]
highest = [run.kinetic_energy.max() for run in runs]
for mass, energy in zip(masses, highest):
    print(f"{mass:.1f} kg: at most {energy:.3f} J")

plt.plot(masses, highest)
plt.xlabel("mass of the lower rod [kg]")
plt.ylabel("largest kinetic energy [J]")
plt.show()

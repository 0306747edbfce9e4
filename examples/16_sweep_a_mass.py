"""Sweep a mass and plot: the largest kinetic energy of a double pendulum over its lower mass.

Run it with `python examples/16_sweep_a_mass.py`; it needs `pip install 'pgraph-dynamics[plot]'`.
"""

# pyright: reportUnknownMemberType=false
# ... because matplotlib types its keyword arguments only in part.

import matplotlib.pyplot as plt
import numpy as np

import pgraph_core as pg

model = pg.load("double_pendulum")
masses = np.linspace(0.5, 4.0, 8)
sweep = pg.sweep(model, {"bodies.lower.mass": masses}, "max kinetic_energy", t_end=2.0)
highest = sweep.values["max kinetic_energy"]
for mass, energy in zip(masses, highest):
    print(f"{mass:.1f} kg: at most {energy:.3f} J")

plt.plot(masses, highest)
plt.xlabel("mass of the lower rod [kg]")
plt.ylabel("largest kinetic energy [J]")
plt.show()

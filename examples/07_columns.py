"""A comb of a thousand teeth from NumPy columns, hung elsewhere, and the state that goes over.

Run it with `python examples/07_columns.py`; the first run on a machine compiles for some seconds.
"""

import numpy as np

import pgraph_core as pg

n = 1000  # links of the back; every link carries a tooth
back = np.arange(n)  # row i hangs on row i - 1, the first on the ground (0)
teeth = np.arange(1, n + 1)  # row n + i hangs on row i
comb = pg.Model.from_columns(
    np.concatenate((back, teeth)),
    link=np.repeat([[0.01, 0.0, 0.0], [0.0, 0.0, -0.05]], n, axis=0),
    axes=(0.0, 1.0, 0.0),  # one entry for all rows
    mass=np.repeat([0.02, 0.005], n),
    com=(0.0, 0.0, -0.02),
    inertia=1e-6 * np.eye(3),
)
mech = pg.Mechanism(comb)
print("bodies, tips      ", mech.nb, len(mech.tips))
print("Pgraph begins     ", mech.pgraph[:7], "and is", len(mech.pgraph), "long")

q, v = mech.home()
q[:] = np.linspace(0.0, 0.1, mech.nq)
other = mech.edit("2000", parent="1")  # the last tooth goes to the first link
q_other, v_other, reset = other.state_from(mech, q, v)
tooth = (m.joints["2000"].q for m in (mech, other))
print("its number         ", mech.names.index("2000") + 1, "->", other.names.index("2000") + 1)
print("its angle is kept: ", q[next(tooth)] == q_other[next(tooth)], "and reset:", reset)
print("back where it was: ", np.array_equal(other.edit("2000", parent="1000").pgraph, mech.pgraph))

try:
    pg.Model.from_columns([0, 1, 2], mass=[1.0, -1.0, 1.0])
except pg.ModelError as error:
    print(error)

"""The equations of motion of a model: mass matrix, bias, Jacobian, forward and inverse dynamics.

Run it with `python examples/03_dynamics.py`.
"""

import numpy as np

import pgraph_core as pg

mech = pg.Mechanism(pg.load("fig1_tree"))
q, _ = mech.home()
v = np.linspace(-1, 1, mech.nv)

M = mech.mass_matrix(q)  # eq. (25)
C = mech.bias_force(q, v)  # eq. (25), gravity included
print("M is symmetric:", np.allclose(M, M.T), " smallest eigenvalue:", np.linalg.eigvalsh(M)[0])

tau = np.ones(mech.nv)
vdot = mech.forward_dynamics(q, v, tau)  # eq. (26), in O(n)
print("M vdot + C = tau to", np.abs(M @ vdot + C - tau).max())
print("inverse dynamics gives tau back to", np.abs(mech.inverse_dynamics(q, v, vdot) - tau).max())

J = mech.jacobian(q, "7")  # eq. (20): [angular; linear] velocity of body 7 = J v
position, rotation = mech.pose(q, "7")
print("Jacobian", J.shape, " body 7 is at", position.round(3))

push = mech.external_at(q, "7", (0, 0, 0, 1, 0, 0))  # 1 N along x at the tip of body 7
print("pushed, vdot changes by", mech.forward_dynamics(q, v, tau, push) - vdot)

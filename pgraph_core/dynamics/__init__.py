"""Dynamics: non-iterative computations on a packed model at a given state.

`Dynamics` is the base of the public `Mechanism`; `analysis` stands between the two. `Scene` is what
the kernels take of a run.
"""

from .dynamics import Dynamics as Dynamics
from .dynamics import model_of as model_of

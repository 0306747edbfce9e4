"""The paper's operators in plain NumPy and SciPy: to look at, and the oracle of the kernels.

Nothing here is fast, everything stands as the paper writes it, with the errata of
docs/conventions.md. `Operators(model, topology, q, v)` holds them all for one state.
"""

from .motion import frames as frames
from .motion import home_poses as home_poses
from .motion import kernel_operator as kernel_operator
from .motion import kernel_operator_of_pgraph as kernel_operator_of_pgraph
from .motion import phi as phi
from .motion import propagation_operator as propagation_operator
from .paper import Operators as Operators

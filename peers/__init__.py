"""Other engines: one builder each, from a model of Pgraph, for reports, benchmarks and tests.

`mujoco`, `pinocchio`, `exudyn` and `drake` build their engine's model from the same elementary
rows (`rows`); `motion` is the motion that a report compares; `solvers` gives Pgraph's own equations
to other integrators. An engine is imported only by the
functions that need it. Installed, this folder is the package `pgraph_peers`; reports find its
`Peer` objects by the entry points "pgraph.peers".
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

from pgraph_core import Mechanism

from .motion import exported
from .rows import Array


class Peer(NamedTuple):
    """An engine that may be installed."""

    module: str  # module of this package
    label: str
    package: str  # for pip
    imports: str  # the engine's top-level module
    integrator: str = ""  # the class of `module`, of one that integrates Pgraph's own equations

    @property
    def installed(self) -> bool:
        """True if the engine can be imported."""
        return find_spec(self.imports) is not None

    def run(
        self, mech: Mechanism, q: Array, v: Array, t: Array, scenario: str | None, tau: Any
    ) -> Any:
        """The motion from (q, v) over the times t, built: its methods by name, run by `by`.

        Raises Refused if the engine does not get all of it.
        """
        builder = import_module(f".{self.module}", __name__)
        if self.integrator:
            return getattr(builder, self.integrator)(mech, q, v, t, scenario, tau)
        return builder.Run(exported(mech, q, v, t, scenario, tau))


MUJOCO = Peer("mujoco", "MuJoCo", "mujoco", "mujoco")
PINOCCHIO = Peer("pinocchio", "Pinocchio + SciPy", "pin", "pinocchio")
EXUDYN = Peer("exudyn", "Exudyn", "exudyn", "exudyn")
SUNDIALS = Peer("solvers", "SUNDIALS", "scikit-sundae", "sksundae", "Sundials")
SCIPY = Peer("solvers", "SciPy", "scipy", "scipy", "Scipy")

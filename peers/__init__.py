"""Other engines: one builder each, from a model of Pgraph, for reports, benchmarks and tests.

`mujoco`, `pinocchio`, `exudyn` and `drake` build their engine's model from the same elementary
rows (`rows`); `motion` is the motion that a report compares. An engine is imported only by the
functions that need it. Installed, this package is called `pgraph_peers`.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

from .motion import Refused as Refused
from .motion import exported as exported


class Peer(NamedTuple):
    """An engine that may be installed."""

    label: str
    package: str  # for pip
    imports: str  # its top-level module


PEERS = {
    "mujoco": Peer("MuJoCo", "mujoco", "mujoco"),
    "pinocchio": Peer("Pinocchio + SciPy", "pin", "pinocchio"),
    "exudyn": Peer("Exudyn", "exudyn", "exudyn"),
}


def installed(name: str) -> bool:
    """Whether an engine can be imported."""
    return find_spec(PEERS[name].imports) is not None


def engine(name: str) -> Any:
    """The builder of an engine; its `Run` makes a motion."""
    return import_module(f".{name}", __name__)

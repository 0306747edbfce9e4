"""Other engines on the motion that a mechanism makes: the same model, the same grid of times.

A peer is imported where one of its functions is called, and only there.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple


class Peer(NamedTuple):
    """An engine that may be installed."""

    label: str
    package: str  # as pip calls it
    imports: str  # what it is imported as


PEERS = {
    "mujoco": Peer("MuJoCo", "mujoco", "mujoco"),
    "pinocchio": Peer("Pinocchio + SciPy", "pin", "pinocchio"),
    "exudyn": Peer("Exudyn", "exudyn", "exudyn"),
}


def installed(name: str) -> bool:
    """Whether a peer can be imported."""
    return find_spec(PEERS[name].imports) is not None

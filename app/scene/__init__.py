"""The 3D view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .. import pose

SHOWN_AT_FIRST = frozenset({"shapes", "joining", "sites", "branches", "forces"})


@dataclass(frozen=True)
class Client(pose.Client):
    turned: bool = False  # whether a person moved its camera since it was set
    follow: bool = True  # whether its camera goes along with what travels


@dataclass(frozen=True)
class State(pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    shown: frozenset[str] = SHOWN_AT_FIRST

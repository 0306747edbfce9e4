"""The table of the bodies."""

from __future__ import annotations

from ..model import Client as Client
from ..model import State as State

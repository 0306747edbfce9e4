"""The form of the selected bodies, and that of the world."""

from __future__ import annotations

from ..model import Client as Client
from ..model import State as State

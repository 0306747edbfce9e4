"""Forms for the selected bodies and for the world."""

from __future__ import annotations

from ..model import Client as Client
from ..model import State as State

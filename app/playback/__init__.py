"""Playback of a run: play, scrub, step, speed, loop."""

from __future__ import annotations

from ..run import Client as Client
from ..run import State as State

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # playback speeds

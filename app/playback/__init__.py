"""Playing a run: play, scrub, step, speed, loop."""

from __future__ import annotations

from dataclasses import dataclass

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # of playback


@dataclass(frozen=True)
class Playback:
    time: float = 0.0  # [s]
    playing: bool = False
    speed: float = 1.0
    loop: bool = True

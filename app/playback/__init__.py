"""Playback of a run: play, scrub, step, speed, loop."""

from __future__ import annotations

from dataclasses import dataclass

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # playback speeds


@dataclass(frozen=True)
class Playback:
    time: float = 0.0  # [s]
    playing: bool = False
    preview: bool = False  # True while a new run is shown once, until a person takes over
    unseen: bool = False  # the preview waits at its beginning for the first page that has a 3D view
    speed: float = 1.0
    loop: bool = True

    @property
    def moves(self) -> bool:
        """True if time is advancing."""
        return self.playing or (self.preview and not self.unseen)

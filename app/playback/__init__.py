"""Playing a run: play, scrub, step, speed, loop."""

from __future__ import annotations

from dataclasses import dataclass

SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)  # playback speeds


@dataclass(frozen=True)
class Playback:
    time: float = 0.0  # [s]
    playing: bool = False
    preview: bool = False  # what has just been computed is shown once, until somebody takes over
    unseen: bool = False  # the preview waits at its beginning for the first page that has a 3D view
    speed: float = 1.0
    loop: bool = True

    @property
    def moves(self) -> bool:
        """Whether time goes on."""
        return self.playing or (self.preview and not self.unseen)

"""One point of the diagram: what a method reached at one setting, and what it cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .errors import Errors
from .ladder import Setting
from .sides import Outcome, Side
from .timing import Spread


@dataclass(frozen=True)
class Row:
    """A run of a study. What could not be measured is None."""

    method: str  # "rk4", or with the peer before it: "MuJoCo rk4"
    peer: str  # "" for ours
    step: float | None  # [s]
    rtol: float | None
    ok: bool
    reason: str  # why not, in words
    error: float | None = None  # E_rms
    error_end: float | None = None
    error_max: float | None = None
    limited: bool = False  # the reference tells no smaller error apart
    error_estimate: float | None = None  # the run's own [rad, m]
    energy_drift: float | None = None  # of the range of the energies
    constraint_drift: tuple[float, float] | None = None  # position [m, rad], velocity
    gap_violation: float | None = None  # deepest penetration [m]
    counters: Mapping[str, int] | None = None
    seconds: Spread | None = None  # quartiles of the stepping loop [s]
    ratio: Spread | None = None  # to the baseline of the same round
    us_per_step: float | None = None
    real_time_factor: float | None = None  # simulated over computed time

    @property
    def setting(self) -> Setting:
        """Step or tolerance."""
        return Setting(self.step, self.rtol)

    @property
    def digits(self) -> float | None:
        """-log10 of the error; at the reference's limit at least so many."""
        if self.error is None:
            return None
        return float(-np.log10(self.error)) if self.error > 0 else 17.0

    @property
    def time(self) -> float | None:
        """Median [s]."""
        return None if self.seconds is None else self.seconds[1]

    def timed(self, seconds: Spread, ratio: Spread, duration: float) -> Row:
        """With what the rounds measured."""
        steps = (self.counters or {}).get("steps", 0)
        return replace(
            self,
            seconds=seconds,
            ratio=ratio,
            us_per_step=1e6 * seconds[1] / steps if steps else None,
            real_time_factor=duration / seconds[1],
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as JSON takes them."""
        data = {name: getattr(self, name) for name in self.__dataclass_fields__}
        counters = None if self.counters is None else dict(self.counters)
        return data | {"counters": counters, "digits": self.digits}


def row(side: Side, setting: Setting, done: Outcome, found: Errors | None, limit: float) -> Row:
    """What one run reached; errors below `limit` are that of the reference."""
    limited = found is not None and found.rms < limit
    rms = None if found is None else max(found.rms, limit) if limited else found.rms
    drift = done.drift if all(map(np.isfinite, done.drift)) else None
    return Row(
        side.name,
        side.peer,
        setting.step,
        setting.rtol,
        done.ok,
        done.reason,
        rms,
        None if found is None else found.end,
        None if found is None else found.most,
        limited,
        _known(done.estimate),
        _known(done.energy_drift),
        drift,
        _known(done.gap),
        dict(done.counters),
    )


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

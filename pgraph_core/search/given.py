"""The arguments of a fit: its measurements, its noise and what is known beforehand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import choices, shown
from ..result import Result
from .free import Numbers

Array = np.ndarray


def cases_of(data: Any) -> dict[str, tuple[Any, Mapping[str, Any]]]:
    """Return the data and the arguments of `simulate` for each case. A single case has the name
    ""."""
    tables = (Mapping, str, FilePath, tuple, Result)
    several = (
        isinstance(data, Mapping)
        and data
        and all(isinstance(one, tables) or hasattr(one, "columns") for one in data.values())
    )
    if not several:
        return {"": (data, {})}
    pairs = {
        str(name): one if isinstance(one, tuple) and len(one) == 2 else (one, {})
        for name, one in data.items()
    }
    return {name: (one, dict(own)) for name, (one, own) in pairs.items()}


def noise_of(numbers: Numbers, labels: Sequence[str], sigma: Any) -> Array | None:
    """(columns,) standard deviations, None if they are not given. Raises InputError."""
    if sigma is None:
        return None
    names = [label.rpartition("@")[0] or label for label in labels]
    known = {*names, *labels}
    if not isinstance(sigma, Mapping) or {*sigma} - known:
        text = f"needs a number for each column, {choices(known)}, got {shown(sigma)}"
        raise numbers.refused("sigma", text)
    given = [sigma.get(label, sigma.get(name)) for label, name in zip(labels, names)]
    found = np.array([x if isinstance(x, float | int) else math.nan for x in given], float)
    if not (np.isfinite(found) & (found > 0.0)).all():
        text = f"needs a number > 0 for each column, {choices(known)}, got {shown(sigma)}"
        raise numbers.refused("sigma", text)
    return found


def priors_of(numbers: Numbers, priors: Any) -> Array:
    """(free, 2) expected values and standard deviations, infinite without a prior."""
    found, names = np.tile([0.0, np.inf], (len(numbers), 1)), numbers.names
    for name, pair in (priors or {}).items():
        if name not in names:
            raise numbers.refused("priors", f"{name!r} is not free; choose from {choices(names)}")
        try:
            mean, spread = map(float, pair)
        except (TypeError, ValueError):
            mean = spread = math.nan
        if not (math.isfinite(mean) and 0.0 < spread < math.inf):
            raise numbers.refused(
                "priors", f"{name!r} needs (value, spread > 0), got {shown(pair)}"
            )
        found[names.index(name)] = mean, spread
    return found

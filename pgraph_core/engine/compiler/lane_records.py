"""Records for many instances: a kernel reads `leg.offset` as a lane of W instead of one number.

An array of records in lanes is a C-contiguous float64 array (records, words, W), a word for each
number of the record; see `lowering.lane_records`.
"""

from __future__ import annotations

from typing import Any

from .jit import late


def in_lanes_of(kind: Any) -> Any:
    """Return a function that views a float64 array (records, words, W) as records in lanes."""
    return late("lane_records", "in_lanes_of", None, kind)


def in_each(function: Any) -> Any:
    """Apply a compiled function of one number to each element of a lane, or to a number."""
    return late("lane_records", "in_each", function, function)

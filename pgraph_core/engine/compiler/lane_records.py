"""Records of many instances: what a kernel reads as `leg.offset` of one, it reads as a lane of W.

An array of records in lanes is a C-contiguous float64 array (records, words, W), a word for each
number of the record; see `lowering.lane_records`.
"""

from __future__ import annotations

from typing import Any

from .jit import late


def in_lanes_of(kind: Any) -> Any:
    """A function of a float64 array (records, words, W): the records in lanes over its memory."""
    return late("lane_records", "in_lanes_of", None, kind)


def in_each(function: Any) -> Any:
    """A compiled function of one number as one of a number or a lane, place after place."""
    return late("lane_records", "in_each", function, function)

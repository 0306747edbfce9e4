"""Code generation for `tables` in numba."""

from __future__ import annotations

from typing import Any

from .elementary import place_of, with_place
from .kinds import INLINED, overload
from .lane import LANE_WIDTH, Lane


def entry(table: Any, i: Any, column: Any) -> Any:
    """Return table[i, column] of a whole number i, or in each place of a lane."""
    return table[int(i), column]


@overload(entry, jit_options=INLINED, strict=False)
def _entry(table: Any, i: Any, column: Any) -> Any:
    if not isinstance(i, Lane):
        return lambda table, i, column: table[int(i), column]
    if isinstance(table.dtype, Lane):

        def of_lanes(table: Any, i: Any, column: Any) -> Any:
            found = i
            for n in range(LANE_WIDTH):
                found = with_place(found, n, place_of(table[int(place_of(i, n)), column], n))
            return found

        return of_lanes

    def of_numbers(table: Any, i: Any, column: Any) -> Any:
        found = i
        for n in range(LANE_WIDTH):
            found = with_place(found, n, table[int(place_of(i, n)), column])
        return found

    return of_numbers

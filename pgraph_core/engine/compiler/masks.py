"""Masks are lanes of ones and zeros, which select values without branches.

Loops continue while `any_of` a mask is set, so finished lanes wait for the others. Each lane
performs the operations of a single instance in the same order, so the results are equal bit for
bit. The functions also work for numbers, so that kernels may be written once for both.
"""

from __future__ import annotations

from typing import Any

from .jit import late

more: Any = late("masks", "more", lambda x, y: float(x > y))
most: Any = late("masks", "most", lambda x, y: float(x <= y))  # the first is at most the second
larger: Any = late("masks", "larger", max)
smaller: Any = late("masks", "smaller", min)
both: Any = late("masks", "both", lambda x, y: float(x != 0.0 and y != 0.0))
either: Any = late("masks", "either", lambda x, y: float(x != 0.0 or y != 0.0))
without: Any = late("masks", "without", lambda x, y: float(x != 0.0 and y == 0.0))
chosen: Any = late("masks", "chosen", lambda mask, a, b: a if mask else b)  # a where it is set
any_of: Any = late("masks", "any_of", lambda x: x != 0.0)  # whether it is set anywhere

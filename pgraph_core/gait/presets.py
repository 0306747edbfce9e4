"""The built-in gaits of `gaits.json`, for a quadruped of about 33 kg with half-metre legs.

Their gains were found by a search over short walks (cross entropy).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ..errors import explained, refusal, shown
from ..model import Gait

FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")


@explained
def gaits(feet: Sequence[str] = FEET) -> dict[str, Gait]:
    """Return the built-in gaits by name.

    Parameters
    ----------
    feet : sequence of str, optional
        Names of the contacts of the left front, right front, left hind and right hind foot.

    Raises
    ------
    InputError
        If there are not four names.
    """
    if isinstance(feet, str) or len(feet) != 4:
        raise refusal("gaits", "feet", f"must be the names of four contacts; given {shown(feet)}")
    known = json.loads(Path(__file__).with_name("gaits.json").read_text(encoding="utf-8"))
    for gait in known.values():
        gait["feet"] = [{"foot": foot, **fall} for foot, fall in zip(feet, gait["feet"])]
    return {name: Gait(name=name, **gait) for name, gait in known.items()}

"""State of a control: the speed of a leaf on the ground without mass, whose armature is 1.

Its rate acts on it as a force, nothing else does, and it has no energy.
"""

from .. import layout as at
from ..compiler.jit import part
from ..rows import (
    home_axis,
    rotation_of,
    set_axis,
    set_coriolis,
    set_link,
    set_rotation,
    set_spin,
)
from .slider import SLIDER


@part
def place(rows, work, k, const, q):
    set_axis(work, k, home_axis(const, k))
    set_rotation(work, k, rotation_of(work, 0))
    set_link(work, k, (0.0, 0.0, 0.0))


@part
def set_rates(rows, work, k, const, v):
    none = (0.0, 0.0, 0.0)
    set_spin(work, k, none)
    set_coriolis(work, k, none, none)


STATE = SLIDER._replace(
    number=at.STATE, inert=True, travels=False, place=place, set_rates=set_rates
)

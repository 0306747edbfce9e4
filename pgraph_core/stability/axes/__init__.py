"""The axes of the stability map, by name."""

from __future__ import annotations

from ..axis import Axis
from .chain_length import CHAIN_LENGTH
from .contact_stiffness import CONTACT_STIFFNESS
from .damping_ratio import DAMPING_RATIO
from .friction import FRICTION
from .inertia import INERTIA
from .joint_friction import JOINT_FRICTION
from .mass_ratio import MASS_RATIO
from .redundancy import REDUNDANCY
from .scales import LENGTH_SCALE, MASS_SCALE, TIME_SCALE
from .singularity import SINGULARITY
from .speed import SPEED
from .step import STEP
from .stiffness import STIFFNESS

AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        STIFFNESS,
        DAMPING_RATIO,
        CONTACT_STIFFNESS,
        MASS_RATIO,
        INERTIA,
        CHAIN_LENGTH,
        SPEED,
        FRICTION,
        JOINT_FRICTION,
        REDUNDANCY,
        SINGULARITY,
        LENGTH_SCALE,
        MASS_SCALE,
        TIME_SCALE,
        STEP,
    )
}

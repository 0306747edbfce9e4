"""Models of muscles: one file per model, which answers the questions of `MuscleModel`."""

from . import degroote2016, millard2012, mujoco, thelen2003
from .model import ACTIVE, PASSIVE, TENDON, VELOCITY, Curves, MuscleModel, Smooth

MODELS: dict[str, MuscleModel] = {
    "degroote2016": degroote2016.MODEL,
    "thelen2003": thelen2003.MODEL,
    "millard2012": millard2012.MODEL,
    "mujoco": mujoco.MODEL,
}
__all__ = [
    "ACTIVE", "MODELS", "PASSIVE", "TENDON", "VELOCITY", "Curves", "MuscleModel", "Smooth",
]  # fmt: skip

"""The step: the model stays as it is."""

from ..axis import Axis

STEP = Axis(
    "step", "step of the run", "s", (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5), of_steps=True
)

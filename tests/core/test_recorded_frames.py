"""Recording a frame reads the state of a run and changes nothing of it."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from ..nights import combined

STEPS = 60


@pytest.mark.parametrize(
    ("name", "method", "step"),
    combined(
        ["slider_crank", "four_bar", "bricard", "andrews", "skate"],
        ["semi_implicit_euler", "rk4", "gauss6"],
        [1e-5, 1e-3],
    ),
)
def test_a_motion_has_the_same_bits_at_any_number_of_frames(name, method, step):
    """The energies of a frame once overwrote the factors by which the next state is projected."""
    model = pg.Model.load(pgraph_models.path(name))
    length = step if name != "andrews" else 0.01 * step  # its motion takes hundredths of a second
    ends = []
    for frames in (2, STEPS // 4 + 1, STEPS + 1):
        run = pg.simulate(
            model, t_end=STEPS * length, step=length, method=method, frames=frames, estimate=False
        )
        ends.append(np.concatenate((run.q[-1], run.v[-1])))
    assert all(np.array_equal(ends[0], end) for end in ends[1:])

"""Parts without effect change nothing."""

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


def touching(law) -> dict:
    return {"contacts": (pg.Contact(name="c", body="6", law=law, points=((0.0, 0.0, 0.0),)),)}


def force(kind: str, **more) -> dict:
    return {"forces": (pg.Force(name="f", kind=kind, body="6", **more),)}


@pytest.mark.parametrize(
    "change",
    [
        {"constraints": (pg.Constraint(name="c", body="6", active=False),)},
        force("spring", rest=1.0),
        force("motor"),
        force("servo"),
        force("wrench"),
        touching("soft"),
        touching("complementarity"),
        ("6", {"limits": (-1e6, 1e6)}),
        ("7", {"joint": "revolute", "axes": ((0, 1, 0),), "armature": 1e300}),  # as if welded
    ],
)
def test_a_part_without_effect_changes_nothing(change):
    """Positions of six rods 100 m above the ground, a body welded to the last, agree to 1e-14."""
    model = pg.Model.serial(7).edit("1", link=(0.0, 0.0, 100.0), v=(1.0,))
    lean = model.edit("7", joint="weld")
    laden = (
        lean.replace(**change) if isinstance(change, dict) else lean.edit(change[0], **change[1])
    )
    options = {"t_end": 0.4, "step": 1e-3, "method": "rk4", "frames": 11, "estimate": False}
    one, two = pg.simulate(lean, **options), pg.simulate(laden, **options)
    assert one.status.ok
    assert two.status.ok
    assert np.abs(one.q - two.q[:, : one.q.shape[1]]).max() <= 1e-14 * np.abs(one.q).max()

"""The plan: the parts of the equations that a scene needs, and that the others change nothing."""

from __future__ import annotations

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models

from .test_cases import mass

pytestmark = pytest.mark.quick


def chain() -> pg.Model:
    """Six rods 100 m above the ground, and a welded one at their end."""
    model = pg.Model.serial(7).edit("1", link=(0.0, 0.0, 100.0), v=(1.0,))
    return model.edit("7", joint="weld")


def touching(law) -> dict:
    return {"contacts": (pg.Contact(name="c", body="6", law=law, points=((0.0, 0.0, 0.0),)),)}


FORCED = {  # parts without effect, and what the plan then needs besides the tree
    "an inactive constraint": (
        {"constraints": (pg.Constraint(name="c", body="6", active=False),)}, set()),
    "a spring without stiffness": (
        {"forces": (pg.Force(name="s", kind="spring", body="6", rest=1.0),)}, None),
    "a motor without torque": ({"forces": (pg.Force(name="m", body="6"),)}, {"drives"}),
    "a servo without gain": ({"forces": (pg.Force(name="s", kind="servo", body="6"),)}, None),
    "a wrench of zero": ({"forces": (pg.Force(name="w", kind="wrench", body="6"),)}, {"loads"}),
    "a limit out of reach": (("6", {"limits": (-1e6, 1e6)}), {"limits", "impulses"}),
    "a soft contact far away": (touching("soft"), {"contacts", "jacobian"}),
    "a rigid contact far away": (touching("complementarity"), {"contacts", "impulses"}),
    "a weld kept as a row": (  # an armature that no torque turns
        ("7", {"joint": "revolute", "axes": ((0, 1, 0),), "armature": 1e300}), None),
}  # fmt: skip


@pytest.mark.parametrize("part", FORCED)
def test_a_needless_part_changes_nothing(part):
    """The part adds zeros, or a row that does not move: positions are equal to 1e-14."""
    change, more = FORCED[part]
    lean, replaced = chain(), isinstance(change, dict)
    laden = lean.replace(**change) if replaced else lean.edit(change[0], **change[1])
    options = {"t_end": 0.4, "step": 1e-3, "method": "rk4", "frames": 11, "estimate": False}
    one, two = pg.simulate(lean, **options), pg.simulate(laden, **options)
    assert one.status.ok
    assert two.status.ok
    assert np.abs(one.q - two.q[:, : one.q.shape[1]]).max() <= 1e-14 * np.abs(one.q).max()
    assert set(pg.Plan.of(lean).needed) == {"tree"}
    assert more is None or set(pg.Plan.of(laden).needed) == {"tree"} | more


def test_the_plan_counts_what_is_left_out():
    mech = pg.Mechanism(chain())
    assert mech.plan().saved["welds"].startswith("1 row")
    assert len(mech.packed.system.rows) - 1 == mech.nb - 1
    idle = pg.Plan.of(chain().replace(**FORCED["an inactive constraint"][0]))
    assert idle.saved["inactive constraints"].startswith("3 rows")
    for name in pgraph_models.names():
        model = built_in(name)
        for scenario in (None, *(s.name for s in model.scenarios)):
            parts = pg.Plan.of(model, scenario=scenario).parts
            assert len({part.name for part in parts}) == len(parts)


def built_in(name):
    return pg.Model.load(pgraph_models.path(name))


def test_the_plan_of_the_stance():
    found = pg.Mechanism(built_in("quadruped")).plan(scenario="stance")
    facts = {"constraints": ("4", "12"), "drives": ("15",), "quaternions": ("pelvis",)}
    for part, numbers in facts.items():
        assert all(number in found.needed[part] for number in numbers)
    assert any("contact" in text for text in found.left_out)
    assert "400" in found.saved["recording"]
    assert set(found.needed).isdisjoint(found.saved)
    assert "16 motions with 21 " in str(found)


def test_a_run_has_its_own_plan():
    mech = pg.Mechanism(built_in("quadruped"))
    run = pg.simulate(mech, scenario="stance", t_end=0.01, step=1e-3, method="rk4")
    assert run.plan == mech.plan(scenario="stance", method="rk4")
    assert run.left_out == run.plan.left_out
    assert run.plan.to_dict()["left_out"] == list(run.left_out)


def test_the_plan_depends_on_the_method_where_that_matters():
    model = pg.Model(bodies=(mass("a", stiffness=3.0), mass("b", "a", limits=(-1.0, None))))
    radau = pg.Plan.of(model, method="radau5")
    assert "4 " in radau.needed["jacobian"]
    explicit = pg.Plan.of(model, method="rk4")
    assert "4 " in explicit.saved["jacobian"]
    assert "events" in explicit.needed
    assert "1 " in explicit.needed["limits"]
    assert "events" not in pg.Plan.of(model, method="moreau_jean").needed


def test_a_run_tells_its_progress_and_can_be_cancelled():
    seen: list[float] = []

    def progress(fraction):
        seen.append(fraction)
        return len(seen) < 8

    options = {"method": "rk4", "step": 1e-4, "frames": 101, "estimate": False}
    run = pg.simulate(built_in("quadruped"), t_end=1000.0, progress=progress, **options)
    assert run.status is pg.Status.CANCELLED
    assert len(seen) == 8
    assert seen == sorted(seen)
    assert run.counters["steps"] < 10_000_000

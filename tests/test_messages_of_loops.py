"""Sentences of constraints that cannot be met, and of switches that do not fit a run."""

from __future__ import annotations

from typing import Any

import pytest

import pgraph_core as pg

pytestmark = pytest.mark.fast

ROD = {"com": (0.5, 0, 0), "inertia": ((0.01, 0, 0), (0, 0.1, 0), (0, 0, 0.1))}


def linkage(**pin: Any) -> pg.Model:
    """Rods of 1 and 1 m from a hinge at the origin, their end pinned."""
    a, b = pg.Body(name="a", **ROD), pg.Body(name="b", parent="a", link=(1, 0, 0), **ROD)
    c = pg.Constraint(**{"name": "pin", "body": "b", "point": (1, 0, 0), **pin})
    return pg.Model(up="y", bodies=(a, b), constraints=(c,))


def on_joint(kind: str, **values: Any) -> pg.Model:
    """Two constraints on the joint of one rod."""
    field = "q_of_t" if kind == "motion" else "value"
    held = tuple(
        pg.Constraint(
            name=name,
            kind=kind,
            body="a",
            **({field: value} if kind == "motion" else {field: value, "coefficients": {"a": 1.0}}),
        )
        for name, value in values.items()
    )
    return pg.Model(up="y", bodies=(pg.Body(name="a", **ROD),), constraints=held)


TORN = "cannot be met: it misses by {} at the nearest position that the joints allow; move its "
OPEN = [
    (
        linkage(other_point=(3, 0, 0)),
        "constraint 'pin': " + TORN.format("1 m") + "points or change a length",
    ),
    (
        linkage(kind="distance", other_point=(0, 0, 0), length=2.5),
        "constraint 'pin': " + TORN.format("0.5 m") + "points or change a length",
    ),
    (
        on_joint(
            "motion",
            left={"t": (0, 1), "value": (0.2, 0.2)},
            right={"t": (0, 1), "value": (0.5,) * 2},
        ),
        "constraint 'right': contradicts 'left': at best they miss by 0.15 rad; change one of "
        "them, or make it inactive",
    ),
    (
        on_joint("velocity", slow=1.0, fast=2.0),
        "constraint 'fast': contradicts 'slow': at best they miss by 0.5 rad/s or m/s; change "
        "one of them, or make it inactive",
    ),
]


@pytest.mark.parametrize(("model", "sentence"), OPEN)
def test_what_cannot_close_is_said_by_name_with_its_gap(model, sentence):
    """By `assemble`, and as the end of a run; the model stays."""
    mech = pg.Mechanism(model)
    before = model.to_json()
    with pytest.raises(pg.InputError) as refused:
        mech.assemble()
    assert str(refused.value) == sentence
    done = pg.simulate(mech, t_end=0.1)
    assert done.status is pg.Status.CANNOT_CLOSE
    assert done.message == f"the constraints cannot all be met: {sentence}"
    assert model.to_json() == before


SWITCHES = [
    ((0.1, "pn", True), "no constraint is named 'pn'; choose one of pin"),
    (
        (0.3, "pin", False),
        "'pin' is switched at t = 0.3 s, outside the run: give a time from 0 s to before 0.2 s",
    ),
    ((-0.1, "pin", False), "of (-0.1, 'pin', False), t must be a time >= 0 [s]; given -0.1"),
    ((0.1, "pin", 2), "of (0.1, 'pin', 2), active must be true or false; given 2"),
    ((0.1, "pin"), "must hold (t, name of a constraint, True or False); given (0.1, 'pin')"),
]


@pytest.mark.parametrize(("switch", "sentence"), SWITCHES)
def test_switches_that_do_not_fit_a_run(switch, sentence):
    mech = pg.Mechanism(linkage())
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(mech, t_end=0.2, switches=(switch,))
    assert str(refused.value) == f"simulate, switches: {sentence}"


def test_switches_that_do_not_fit_a_model():
    bad = [
        {"t": 0.1, "constraint": "pn", "active": True},
        {"t": 0.1, "constraint": "pin", "active": True},
        {"t": 0.1, "constraint": "pin", "active": False},
    ]
    with pytest.raises(pg.ModelError) as refused:
        linkage().replace(scenarios=(pg.Scenario(name="s", switches=bad),))
    assert [str(p) for p in refused.value.problems] == [
        "scenario 's', switches: no constraint is named 'pn'; choose one of pin",
        "scenario 's', switches: 'pin' is switched twice at t = 0.1 s; leave one out",
    ]


def test_velocities_that_a_switch_contradicts():
    mech = pg.Mechanism(on_joint("velocity", slow=1.0, fast=2.0))
    done = pg.simulate(
        mech, t_end=0.2, switches=((0.0, "fast", False), (0.1, "fast", True)), estimate=False
    )
    assert done.message == (
        "the constraints cannot all be met: constraint 'fast': requires velocities at t = 0.1 s "
        "that the others forbid: they miss by 0.5; switch one of them off"
    )

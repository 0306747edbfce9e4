"""Parts without effect change no bit of a run."""

import numpy as np
import pytest

import pgraph_core as pg

LEAN = pg.Model.serial(3).edit("1", link=(0.0, 0.0, 100.0), v=(1.0,))  # 100 m above the ground
LATCH = pg.Constraint(name="latch", body="3", active=False)


def force(kind: str, **more):
    return LEAN.replace(forces=(pg.Force(name="f", kind=kind, body="3", **more),)), {}


def touching(law: str, **more):
    contact = pg.Contact(name="c", body="3", law=law, points=((0.0, 0.0, 0.0),), **more)
    return LEAN.replace(contacts=(contact,)), {}


def waiting(*, contacts=(), **when):
    switch = pg.Switch(constraint="latch", active=True, when=when)
    model = LEAN.replace(constraints=(LATCH,), contacts=contacts)
    return model, {"switches": [switch]}


def never(t, q, v):
    return q[0] - 1000.0


FLOOR = pg.Contact(name="floor", body="3", points=((0.0, 0.0, 0.0),))
SCENARIO = pg.Scenario(name="plain", t_end=0.4)
KINDS = {
    "an inactive constraint": (LEAN.replace(constraints=(LATCH,)), {}),
    "a spring without stiffness": force("spring", rest=1.0),
    "a torsion spring without stiffness": force("torsion"),
    "a drag in no fluid": force("drag", size=(0.1, 0.1, 0.1)),
    "a wrench of zero": force("wrench"),
    "a motor without torque": force("motor"),
    "a servo without gain": force("servo"),
    "an inactive contact": touching("complementarity", active=False),
    "a rigid contact far away": touching("complementarity"),
    "a soft contact far away": touching("soft"),
    "a penalty contact far away": touching("penalty"),
    "limits out of reach": (LEAN.edit("2", limits=(-1e3, 1e3)), {}),
    "a condition that never holds": waiting(coordinate="2", above=1e3),
    "the same beside a far contact": waiting(coordinate="2", below=-1e3, contacts=(FLOOR,)),
    "a gap that stays wide": waiting(gap="floor", below=0.5, contacts=(FLOOR,)),
    "a contact that never pushes": waiting(force="floor", above=1.0, contacts=(FLOOR,)),
    "an event that never happens": (LEAN, {"events": never}),
    "the same over far ground": (LEAN.replace(contacts=(FLOOR,)), {"events": never}),
    "a scenario that adds nothing": (LEAN.replace(scenarios=(SCENARIO,)), {"scenario": "plain"}),
}
DAILY = [{}, {"method": "rk4", "step": 1e-3}, {"method": "radau5", "rtol": 1e-6}]
AT_NIGHT = [
    {"step": 1e-3},
    {"rtol": 1e-5},
    {"method": "semi_implicit_euler", "step": 1e-3},
    {"method": "gauss6", "step": 2e-3},
    {"method": "dopri5"},
    {"method": "radau5", "step": 2e-3},
]
LENGTHS = [{"t_end": 0.02, "frames": 21}, {"t_end": 0.4}]


# radau5 and gauss6 take a step again to look within it, from which Newton's method goes on.
LOOKING_CHANGES_BITS = ("radau5", "gauss6")


def cases():
    """(kind, options of a method) of every pair whose bits agree, and its marks."""
    for n, (kind, (_, options)) in enumerate(KINDS.items()):
        today = DAILY[n % (2 if "events" in options else 3)]
        for way in (*DAILY, *AT_NIGHT):
            if not ("events" in options and way.get("method") in LOOKING_CHANGES_BITS):
                marks = () if way is today else pytest.mark.nightly
                yield pytest.param(kind, way, marks=marks, id=f"{kind}-{way}")


@pytest.mark.parametrize(("kind", "way"), list(cases()))
def test_a_part_without_effect_changes_no_bit(kind, way):
    """Twice each, since a run may go on in the workplace of the one before."""
    model, options = KINDS[kind]
    lean, laden = pg.Mechanism(LEAN), pg.Mechanism(model)
    for length in (*LENGTHS, *LENGTHS):
        one = pg.simulate(lean, **length, **way, estimate=False)
        two = pg.simulate(laden, **length, **way, **options, estimate=False)
        assert one.status.ok
        assert two.header["method"] == one.header["method"]
        for name in ("t", "q", "v", "vdot", "kinetic_energy", "potential_energy"):
            assert np.array_equal(getattr(one, name), getattr(two, name)), (name, length)
        assert two.counters["steps"] == one.counters["steps"]
        assert not two.events
        assert not two.user_events


@pytest.mark.quick
def test_a_joint_of_endless_inertia_is_welded():
    """Positions of six rods with a body on the last agree to 1e-14."""
    model = pg.Model.serial(7)
    welded = model.edit("7", joint="weld")
    heavy = model.edit("7", armature=1e300)
    options = {"t_end": 0.4, "step": 1e-3, "method": "rk4", "frames": 11, "estimate": False}
    one, two = pg.simulate(welded, **options), pg.simulate(heavy, **options)
    assert np.abs(one.q - two.q[:, : one.q.shape[1]]).max() <= 1e-14 * np.abs(one.q).max()

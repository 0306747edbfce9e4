"""Contacts whose friction is an expression."""

import numpy as np
import pytest

import pgraph_core as pg
from app.cli.main import main
from pgraph_core.live.run import LiveRun, Setup
from tests.refusals import assert_names

from ..nights import combined

G, SPEED, END, STEP = 9.81, 3.0, 0.5, 2.0**-9
SLOWED = SPEED - 0.3 * G * (END + 0.5 * END**2)  # by a friction of 0.3 (1 + t)
LAWS = {"complementarity": 1e-9, "soft": 2e-3, "penalty": 2e-3}  # the last two sink and bounce


def box(friction, law="complementarity", **fields):
    """A box that slides on the floor along x."""
    body = pg.Body(
        name="b", joint="planar", axes=[(1, 0, 0), (0, 0, 1), (0, 1, 0)], mass=2.0,
        inertia=(0.1, 0.1, 0.1), q=(0, 0.1, 0), v=(SPEED, 0, 0),
        shape=pg.Shape(kind="box", size=(2.0, 0.2, 0.2)),
    )  # fmt: skip
    touch = pg.Contact(name="floor", body="b", friction=friction, law=law)
    return pg.Model(bodies=[body], contacts=[touch], parameters={"k": 0.3}, **fields)


@pytest.mark.parametrize("law", LAWS)
def test_a_box_is_slowed_by_the_friction_of_the_time(law):
    call = {"method": "moreau_jean", "step": STEP, "estimate": False}
    run = pg.simulate(box("=k*(1 + t)", law), t_end=END, **call)
    assert abs(run.v[-1, 0] - SLOWED) < LAWS[law]


def test_an_adaptive_run_follows_the_friction_of_a_soft_contact():
    call = {"method": "dop853", "rtol": 1e-8, "estimate": False}
    run = pg.simulate(box("=k*(1 + t)", "soft"), t_end=END, **call)
    assert abs(run.v[-1, 0] - SLOWED) < LAWS["soft"]


def test_friction_follows_the_place():
    """With a friction of q, v' = -g q from q = 0 on: q = v₀/√g sin √g t."""
    root = np.sqrt(G)
    off = []
    for step in (2e-3, 1e-3):
        run = pg.simulate(box("=k*q.b/0.3"), t_end=0.4, step=step, method="moreau_jean")
        off.append(abs(run.q[-1, 0] - SPEED / root * np.sin(root * 0.4)))
    assert off[1] < 0.6 * off[0]
    assert off[1] < 2e-3


def test_a_patch_of_ice_holds_less():
    run = pg.simulate(box("=if(q.b > 0.5, 0, k)"), t_end=END, step=STEP, method="moreau_jean")
    assert abs(run.v[-1, 0] - np.sqrt(SPEED**2 - 2 * 0.3 * G * 0.5)) < 0.3 * G * STEP


def test_an_expression_of_a_constant_is_the_constant():
    plain, said = (
        pg.simulate(box(mu), t_end=END, step=STEP, method="moreau_jean") for mu in (0.3, "=k + 0*t")
    )
    assert np.array_equal(said.q, plain.q)
    assert np.array_equal(said.contacts.force["floor"], plain.contacts.force["floor"])


@pytest.mark.parametrize("law", LAWS)
def test_all_ways_to_run_have_the_same_bits(law, tmp_path):
    model = box("=k*(1 + t) + k*abs(v.b)/9", law)
    end, call = 64 * STEP, {"step": STEP, "method": "moreau_jean"}
    run = pg.simulate(model, t_end=end, frames=65, **call)
    stepper, batch = pg.Stepper(model, **call), pg.BatchStepper(model, 3, **call)
    stepper.step(n=64)
    batch.step(n=64)
    last = {"last": lambda run: float(run.q[-1, 0])}
    swept = pg.sweep(model, {"k": [0.2, 0.3]}, last, t_end=end, frames=65, **call)
    model.save(tmp_path / "m.json")
    again = pg.simulate(pg.load(tmp_path / "m.json"), t_end=end, **call)
    own = ["--method", "moreau_jean", "--step", repr(STEP), "-o", str(tmp_path / "m.npz")]
    assert main(["run", str(tmp_path / "m.json"), "--t-end", repr(end), *own]) == 0
    typed = pg.Result.load(tmp_path / "m.npz").q[-1]
    for q in (stepper.q, batch.q[1], again.q[-1], typed):
        assert np.array_equal(q, run.q[-1])
    assert swept["last"][1] == run.q[-1, 0]
    if law == "complementarity":  # others are stepped more finely in runs
        live = LiveRun(pg.Mechanism(model), Setup(step=STEP), "moreau_jean")
        live.record.steps.advance(64)
        assert np.array_equal(live.record.steps.q, run.q[-1])


def test_instances_on_feet_have_their_own_friction():
    """Instances with a constant friction are stepped in lanes, which know no expressions."""
    axes = {"parent": "ground", "joint": "prismatic", "mass": 1.0}
    bodies = [
        pg.Body(name="x", axes=[(1, 0, 0)], v=[SPEED], **axes),
        pg.Body(
            name="b", axes=[(0, 0, 1)], q=[0.1], shape=pg.Shape(kind="sphere", radius=0.1),
            **{**axes, "parent": "x"},
        ),
    ]  # fmt: skip
    floor = pg.Contact(name="floor", body="b", friction="=k*t")
    model = pg.Model(bodies=bodies, contacts=[floor], parameters={"k": 0.3})
    call = {"step": STEP, "method": "moreau_jean"}
    batch = pg.BatchStepper(model, 4, set={"k": [0.0, 0.1, 0.2, 0.3]}, **call)
    batch.step(n=64)
    for k, q in zip((0.0, 0.1, 0.2, 0.3), batch.q):
        one = pg.Stepper(model.replace(parameters={"k": k}), **call)
        one.step(n=64)
        assert np.array_equal(q, one.q)
    assert len({*batch.q[:, 0]}) == 4


REFUSED = [
    ({"friction": "=q.b"}, ["'floor'", "friction", "m"]),
    ({"friction": "=k*q.c"}, ["'c'", "b"]),
    ({"friction": "=mu*t"}, ["'mu'", "k"]),
    ({"friction": "=force.floor*t"}, ["'floor'", "friction", "loop"]),
    ({"friction": "=1 +* t"}, ["'floor'", "friction"]),
    ({"friction": -0.5}, ["friction", ">= 0", "-0.5"]),
    ({"friction": float("nan")}, ["friction", "nan"]),
    ({"friction": "=t", "static_friction": 0.5}, ["static_friction", "=t"]),
]


@pytest.mark.parametrize(("fields", "facts"), REFUSED)
def test_expressions_that_do_not_fit_are_refused(fields, facts):
    with pytest.raises(pg.ModelError) as error:
        box(0.5).edit("floor", **fields)
    assert_names(str(error.value), *facts)


@pytest.mark.parametrize(
    ("law", "text"), combined(LAWS, ["=k*(0.25 - t)", "=k/(t - 0.25) + 9", "=sqrt(0.25 - t)"])
)
def test_a_value_that_no_friction_has_ends_the_run_and_names_the_contact(law, text):
    run = pg.simulate(box(text, law), t_end=END, step=STEP, method="moreau_jean")
    assert not run.status.ok
    assert 0.2 < run.t[-1] < 0.3
    assert_names(run.message, "'floor'", text, "friction")


def test_events_are_not_located_with_it():
    with pytest.raises(pg.InputError) as error:
        pg.simulate(box("=k*t"), t_end=END, method="dop853")
    assert_names(str(error.value), "'floor'", "friction", "moreau_jean")


def test_names_files_and_exports_follow(tmp_path):
    model = box("=k*(1 + q.b/0.1)".replace("q.b/0.1", "v.b*k"))
    model = model.edit("b", name="the body")
    assert model.contacts[0].friction == '=k*(1 + v["the body"]*k)'
    text = model.to_json()
    assert '"schema_version": 9' in text
    assert pg.Model.from_json(text) == model
    constant = box("=2*k")
    assert constant.contacts[0].friction == 0.6
    assert '"schema_version": 9' not in constant.to_json()
    assert pg.Model.from_json(constant.to_json()) == constant
    report = pg.write_mjcf(model, tmp_path / "m.xml")
    assert "friction" in str(report)


def test_a_copy_reads_the_copied_body_and_a_removed_body_takes_its_contacts_along():
    other = pg.Body(name="other", joint="prismatic", axes=[(1, 0, 0)])
    model = box("=0.1").add(other).edit("floor", friction="=abs(k*v.other)")
    assert model.remove("other").contacts == ()
    copied = box("=abs(k*v.b)").duplicate("b")
    assert copied.contacts[1].friction == f"=abs(k*v.{copied.bodies[1].name})"

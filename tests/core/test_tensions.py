"""Tensions of springs, cables and ropes as readings, in expressions, in conditions and in edits."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.model.copies import Mirror
from tests.core.test_cables import TURN, atwood, crane, weight, wheel
from tests.core.test_mirror import image
from tests.refusals import assert_names

BOTH = ("rope[1]", "rope[2]")
CABLES = [  # part, its fields, and a run with frames at the samples
    (pg.Rope, {}, {"rtol": 1e-9}),
    (pg.Cable, {"stiffness": 2e4, "damping": 20.0}, {"rtol": 1e-9}),
    (pg.Cable, {"stiffness": 2e4}, {"method": "rk4", "step": 1e-3}),
]


def samples(*names, sample=0.01):
    return [
        pg.Sampled(name=f"F{k}", update=f"=force.{name}", sample=sample)
        for k, name in enumerate(names)
    ]


@pytest.mark.parametrize(("cable", "more", "how"), CABLES, ids=str)
def test_a_sample_reads_the_tension_of_each_segment(cable, more, how):
    model = atwood(None, cable=cable, **more).replace(controls=samples(*BOTH))
    run = pg.simulate(model, t_end=0.2, frames=21, **how)
    for k, name in enumerate(BOTH):
        assert run.controls[f"F{k}"] == pytest.approx(run.tension[name], rel=1e-12)
    assert np.abs(run.tension["rope[1]"] - run.tension["rope[2]"]).max() > 1.0


def test_a_segment_behind_the_third_is_read():
    """A belt over six wheels of one size, of which the first one is driven."""
    ways = np.arange(6) * np.pi / 3
    names = [f"w{k}" for k in range(6)]
    bodies = [
        wheel(name, 0.02, link=(0.5 * np.sin(s), 0, 0.5 * np.cos(s)))
        for name, s in zip(names, ways)
    ]
    belt = pg.belt(names, radii=0.05, stiffness=1e5, tension=40.0)
    motor = pg.Motor(name="motor", body="w0", torque=1.0)
    wanted = [f"belt[{k}]" for k in range(1, 7)]
    model = pg.Model(bodies=bodies, forces=(belt, motor), controls=samples(*wanted, sample=0.02))
    run = pg.simulate(model, t_end=0.1, frames=6, rtol=1e-9)
    found = np.array([run.tension[name] for name in wanted])
    assert np.array([run.controls[f"F{k}"] for k in range(6)]) == pytest.approx(found, rel=1e-12)
    assert len(np.unique(found[:, -1].round(6))) > 3


def sprung(**fields):
    """Return a weight on a spring and a strut, beside a spring that never acts."""
    spring = pg.Spring(name="spring", body="a", stiffness=60.0, damping=1.0, rest=0.9,
                       point=(0, 0, 0), other_point=(0, 0, 0))  # fmt: skip
    idle = pg.Spring(name="idle", body="a", stiffness=0.0, point=(0, 0, 0), other_point=(1, 0, 0))
    strut = pg.Strut(name="strut", body="a", point=(0, 0, 0), other_point=(0.2, 0, 0),
                     spring=pg.Lines(x=(0.0, 2.0), value=(-90.0, 90.0)))  # fmt: skip
    forces = [*fields.pop("forces", ()), idle, spring, strut]
    gravity = (0.0, 0.0, -9.81)
    return pg.Model(bodies=[weight("a", 2.0, 0.0)], forces=forces, gravity=gravity, **fields)


@pytest.mark.parametrize(
    ("v", "when", "passed"),
    [
        (0.0, {"force": "spring", "above": 10.0}, lambda run: run.tension["spring"] > 10.0),
        (0.0, {"holds": "=force.spring > 10"}, lambda run: run.tension["spring"] > 10.0),
        (2.5, {"force": "strut", "below": -10.0}, lambda run: run.tension["strut"] < -10.0),
    ],
)
def test_conditions_find_when_a_tension_passes_a_value(v, when, passed):
    """A strut that pushes has a negative one. A spring that never acts has no row."""
    catch = pg.Weld(name="catch", body="a", active=False)
    switch = {"constraint": "catch", "active": True, "when": when}
    scenario = pg.Scenario(name="s", switches=[switch], t_end=0.4)
    model = sprung(constraints=[catch], scenarios=[scenario])
    free = pg.simulate(sprung(), v=[v], t_end=0.4, rtol=1e-10, frames=8001)
    first = free.t[np.argmax(passed(free))]
    assert first > 0.01
    run = pg.simulate(model, v=[v], scenario="s", rtol=1e-10)
    assert [event.t for event in run.events] == pytest.approx([first], abs=1e-4)


@pytest.mark.parametrize(("cable", "more", "how"), CABLES, ids=str)
def test_steppers_and_batches_have_the_tensions_of_a_run(cable, more, how):
    model, step = atwood(None, cable=cable, **more), {"method": "rk4", "step": 1e-3}
    run = pg.simulate(model, t_end=0.02, frames=3, **step)
    stepper, quiet = pg.Stepper(model, **step), pg.Stepper(model, **step)
    batch = pg.BatchStepper(model, 2, **step)
    for i in range(1, 21):
        for one in (stepper, quiet, batch):
            one.step()
        for name, tension in stepper.tension.items():
            assert (i % 10) or tension == pytest.approx(run.tension[name][i // 10], rel=1e-12)
            assert batch.tension[name] == pytest.approx([tension] * 2, rel=1e-12)
    assert set(stepper.tension) == set(run.tension) == set(batch.tension)
    assert np.array_equal(stepper.q, quiet.q)  # readings change nothing


def test_a_stepper_reads_the_joint_forces_of_a_rope():
    """The hinge of the sheave carries both tensions and its weight of 9.81 N."""
    output = pg.Output("held", at="sheave", kind="force")
    for cable, more in ((pg.Rope, {}), (pg.Cable, {"stiffness": 2e4})):
        stepper = pg.Stepper(atwood(None, cable=cable, **more).add(output), step=1e-3, method="rk4")
        stepper.step()
        pulls = sum(stepper.tension.values()) + 9.81
        assert abs(stepper.outputs["held"][2]) == pytest.approx(pulls, rel=1e-9)


def test_a_stepper_has_the_tensions_of_springs_that_never_act():
    stepper = pg.Stepper(sprung(), step=1e-3, method="rk4")
    run = pg.simulate(sprung(), t_end=1e-3, step=1e-3, method="rk4", frames=2)
    stepper.step()
    assert stepper.tension == pytest.approx({k: x[-1] for k, x in run.tension.items()}, rel=1e-12)


def test_a_cable_that_does_not_stretch_has_a_tension_and_a_length():
    model = atwood(None, cable=pg.Cable).replace(controls=samples(*BOTH))
    run = pg.simulate(model, t_end=0.2, frames=21, step=1e-3)
    a = 2.0 * 9.81 / (4.0 + 2.0)
    for k, (name, pull) in enumerate(zip(BOTH, (3 * (9.81 - a), 9.81 + a))):
        assert run.tension[name] == pytest.approx(pull, rel=1e-6)
        assert run.controls[f"F{k}"][1:] == pytest.approx(pull, rel=1e-6)
        assert run.path_length[name] == pytest.approx(1.0 + 0.5 * k - run.q[:, 1 + k], rel=1e-9)
    stepper, batch = pg.Stepper(model, step=1e-3), pg.BatchStepper(model, 2, step=1e-3)
    for one in (stepper, batch):
        for _ in range(20):
            one.step()
    assert stepper.tension["rope[2]"] == pytest.approx(9.81 + a, rel=1e-6)
    assert batch.tension["rope[2]"] == pytest.approx([9.81 + a] * 2, rel=1e-6)


def test_a_cable_that_slackens_switches_a_brake_on():
    """The weights fly up until the cable is taut again: then its tension passes 5 N."""
    brake = pg.Weld(name="brake", body="sheave", active=False)
    when = {"force": "rope", "above": 5.0}
    switch = {"constraint": "brake", "active": True, "when": when}
    scenario = pg.Scenario(name="s", switches=[switch], t_end=0.5)
    model = atwood(grip=False, cable=pg.Cable).add(brake).add(scenario)
    run = pg.simulate(model, v=[0.0, 0.0, 2.0], scenario="s", step=1e-3)
    found = [event.t for event in run.events if event.contact == "brake"]
    assert found == pytest.approx([2.0 / 9.81], abs=3e-3)


@pytest.mark.parametrize("cable", [{}, {"cable": pg.Cable, "stiffness": 1e4}])
def test_lengths_are_without_what_is_wound_on_drums(cable):
    cable = {"cable": pg.Rope, **cable}
    kind = cable.pop("cable")
    bodies = (wheel("drum", 0.3), weight("load", 20.0, 0.1, -40.0))
    rope = kind(name="rope", through=[pg.Pulley("drum", radius=0.1, side=1), "load"], **cable)
    parts = {"constraints" if kind is pg.Rope else "forces": (rope,)}
    model = pg.Model(bodies=bodies, gravity=(0, 0, -9.81), **parts)
    run = pg.simulate(model, t_end=1.0, frames=11)
    assert run.path_length["rope"] == pytest.approx(40.0 - run.q[:, 1], rel=1e-9)


def refused(text, model, **more):
    control = pg.Sampled(name="F", update=f"={text}", sample=0.1)
    with pytest.raises(pg.ModelError) as error:
        pg.simulate(model.replace(controls=[control]), t_end=0.1, **more)
    return str(error.value)


@pytest.mark.parametrize(("cable", "more"), [(pg.Rope, {}), (pg.Cable, {"stiffness": 1e4})])
def test_segments_must_be_named(cable, more):
    several, one = atwood(None, cable=cable, **more), atwood(False, cable=cable, **more)
    assert_names(refused("force.rope", several), "rope[1]", "rope[2]", "force.rope[1]")
    assert_names(refused("force.rope[7]", several), "at most 2", "7")
    assert_names(refused("force.rope[1]", one), "one segment", "force.rope")
    wait = {"constraint": "hold", "active": True, "when": {"force": "rope", "above": 1.0}}
    hold = pg.Weld(name="hold", body="left", active=False)
    with pytest.raises(pg.ModelError, match=r"rope\[2\]"):
        pg.simulate(several.add(hold), t_end=0.1, switches=[wait])
    wait["when"] = {"force": "rope[2]", "above": 1.0}
    run = pg.simulate(several.add(hold), t_end=0.1, switches=[wait])
    assert len(run.events) == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("force.spring[1]", ("one number", "1")),
        ("force.motor", ("f.motor",)),
        ("force.sprung", ("spring", "strut")),
    ],
)
def test_what_has_no_tension_is_refused(text, told):
    motor = pg.Motor(name="motor", body="a", torque=1.0)
    assert_names(refused(text, sprung(forces=[motor])), *told)


def test_a_force_does_not_read_the_tension_of_its_instant():
    motor = pg.Motor(name="motor", body="a", torque="=-force.spring")
    with pytest.raises(pg.ModelError) as error:
        sprung(forces=[motor])
    assert_names(str(error.value), "force.spring", "motor", "samples")


def test_a_spring_and_a_constraint_of_one_name_have_no_force_of_that_name():
    hold = pg.Weld(name="spring", body="a", active=False)
    told = refused("force.spring", sprung(constraints=[hold]))
    assert_names(told, "constraint", "spring", "rename")


def test_names_and_removals_are_followed(tmp_path):
    switch = {"constraint": "hold", "active": True, "when": {"force": "rope[2]", "above": 1.0}}
    hold = pg.Weld(name="hold", body="left", active=False)
    scenario = pg.Scenario(name="s", switches=[switch])
    model = atwood(None, cable=pg.Cable, stiffness=1e4).replace(controls=samples(*BOTH))
    model = model.add(hold).add(scenario).edit("rope", name="a line")
    assert model.controls[1].update == '=force["a line"][2]'
    assert model.scenario("s").switches[0].when.force == "a line[2]"
    model = model.edit("sheave", name="wheel").edit("right", name="counter")
    assert [x.body for x in model["a line"].through] == ["left", "wheel", "counter"]
    model.save(tmp_path / "m.json")
    assert pg.load(tmp_path / "m.json") == model
    less = model.remove("wheel")
    assert "a line" not in less
    assert not less.controls
    assert not less.scenario("s").switches


@pytest.mark.parametrize(("write", "ending"), [(pg.write_mjcf, "xml"), (pg.write_urdf, "urdf")])
def test_written_files_tell_what_is_lost(write, ending, tmp_path):
    model = crane(stiffness=3e3).add(
        pg.Rope(name="tie", through=["boom", ("ground", (0, 0, 3)), "jib"]),
        pg.CurvePoint(name="track", body="load", other="ground",
                      curve=[(0, 0, 0), (1, 0, 0.2), (2, 0, 0)]),
    )  # fmt: skip
    told = str(write(model, tmp_path / f"crane.{ending}"))
    assert_names(told, "'rope'", "cable", "'tie'", "rope", "'track'", "curve_point")


def hanging():
    """Return the crane with its load on the jib, as one branch."""
    model = crane(stiffness=3e3, tension=40.0).remove("load")
    load = weight("load", 5.0, 0.8, -1.0, parent="jib")
    through = [
        pg.Pulley("drum", radius=0.08, side=1),
        pg.Pulley("boom", point=(0.9, 0.0, 0.1), radius=0.05, axis=TURN),
        pg.Pulley("jib", point=(0.8, 0.1, 0.05), radius=0.06, axis=TURN),
        ("load", (0.02, 0.01, 0.1)),
    ]
    rope = pg.Cable(name="rope", through=through, stiffness=3e3, tension=40.0)
    return model.add(load).add(rope)


@pytest.mark.parametrize("plane", ["x", "y", "z"])
def test_a_mirrored_crane_is_the_mirror_image(plane):
    model, how = hanging(), {"t_end": 0.3, "frames": 4, "rtol": 1e-10}
    other = image(model, plane)
    one, two = pg.simulate(model, **how), pg.simulate(other, **how)
    (own,) = two.tension
    assert two.tension[own] == pytest.approx(one.tension["rope"], rel=1e-6)
    assert np.ptp(one.tension["rope"]) > 1.0
    mirror = Mirror("xyz".index(plane))
    places = np.array([mirror.point(place) for place in one.body_pose[:, -1, :3]])
    assert two.body_pose[:, -1, :3] == pytest.approx(places, abs=1e-7)


@pytest.mark.parametrize(
    ("path", "present"),
    [
        ("forces.rope.through.1.radius", 0.1), ("forces.rope.stiffness", 2e3),
        ("forces.rope.damping", 20.0), ("constraints.rope.through.1.radius", 0.1),
    ],
)  # fmt: skip
def test_derivatives_by_numbers_of_a_cable_are_those_of_runs(path, present):
    more = {"stiffness": 2e3, "damping": 20.0} if path.startswith("f") else {}
    model = atwood(None, cable=pg.Cable if more else pg.Rope, **more)
    how = {"t_end": 0.2, "method": "rk4", "step": 1e-3, "frames": 3}
    run = pg.simulate(model, wrt=[path], **how)
    h = 1e-5 * present
    ends = [pg.simulate(model.edit(path, present + x), **how).q[-1] for x in (h, -h)]
    slope = (ends[0] - ends[1]) / (2 * h)
    found = run.derivatives[path][-1, : len(slope)]
    assert found == pytest.approx(slope, rel=1e-5, abs=1e-7 * np.abs(slope).max())
    assert np.abs(slope).max() > 0.0


def test_segments_count_as_rows():
    model = atwood(None, cable=pg.Rope)
    found = pg.Mechanism(model).mobility()
    assert (found.tree, found.rows, found.dof, found.redundant) == (3, 2, 1, ())
    wheels = (wheel("a"), wheel("b", link=(0.6, 0, 0)))
    fixed = pg.Model(bodies=wheels, constraints=[pg.belt(["a", "b"], 0.1)])
    found = pg.Mechanism(fixed).mobility()
    assert (found.rows, found.dof, len(found.redundant)) == (2, 1, 1)


def test_words_of_other_programs_lead_to_tensions():
    run = pg.simulate(atwood(), t_end=0.01)
    for word, ours in {"ten_length": "path_length", "rope_force": "tension"}.items():
        with pytest.raises(AttributeError, match=ours):
            getattr(run, word)

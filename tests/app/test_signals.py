"""Hints of expressions: names, units, present values and faults, as of the model itself."""

import pytest

import pgraph_core as pg

from .store import ME, after, begun, do, ran


@pytest.fixture(scope="module")
def model() -> pg.Model:
    bodies = [
        pg.Body(name="cart", joint="prismatic", axes=[(1, 0, 0)], q=0.5, v=2.0),
        pg.Body(name="pole", parent="cart", axes=[(0, 0, 1)], q=0.25, v=-1.0),
        pg.Body(name="two arms", parent="cart", joint="universal", q=(0.1, 0.2), v=(0.3, 0.4)),
        pg.Body(name="ball", parent="pole", joint="spherical", v=(1.0, 2.0, 3.0)),
        pg.Body(name="nut", parent="cart", joint="screw", q=0.7, v=0.8),
        pg.Body(name="plate", parent="cart", joint="weld"),
    ]
    return pg.Model(
        bodies=bodies, parameters={"kick": 3.0},
        forces=[
            pg.Motor(name="push", body="cart"),
            pg.Motor(name="turn", body="pole"),
            pg.Wrench(name="wind", body="pole"),
            pg.Servo(name="hold", body="nut", kp=1.0),
        ],
        constraints=[pg.Motion(name="drive", body="nut", q_of_t="=0.7 + sin(t)", active=False)],
        contacts=[pg.Contact(name="foot", body="pole", points=[(0, 0, 0)])],
        outputs=[
            pg.Output(name="tilt", kind="joint_position", at="pole"),
            pg.Output(name="load", kind="force", at="pole"),
        ],
    )  # fmt: skip


def hint(model, text, name="push", cell="torque", part="forces", caret=None, state=None):
    at = len(text) if caret is None else caret
    state = begun(model) if state is None else state
    return after(state, do.AskHint(ME, 1, part, name, cell, text, at)).clients[ME].hint


def words(model, text, **how):
    return [word.text for word in hint(model, text, **how).words]


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("=q.", ["q.cart", "q.pole", 'q["two arms"][0]', 'q["two arms"][1]', "q.nut"]),
        ("=2*q.p", ["q.pole"]),
        ("=v.ba", ["v.ball[0]", "v.ball[1]", "v.ball[2]"]),
        ('=v["two', ['v["two arms"][0]', 'v["two arms"][1]']),
        ("=q.arms", ['q["two arms"][0]', 'q["two arms"][1]']),
        ("=out.", ["out.tilt"]),
        ("=-smo", ["smoothstep("]),
        ("=ki", ["kick"]),
        ("=pole", ["q.pole", "v.pole"]),
        ("=q.pole", []),
        ("=q.cart ", []),
        ("=q.cart*", None),
        ("=2", []),
        ("=nothing", []),
    ],
)
def test_names_are_completed(model, typed, found):
    got = words(model, typed)
    assert got if found is None else got == found


def test_a_completed_name_is_read(model):
    for text in ("=q.", "=v.", "=out.", "=v.ba", '=v["two', "=ki"):
        shown = hint(model, text)
        for word in shown.words:
            whole = text[: shown.start] + word.text
            assert hint(model, f"={whole.lstrip('=')}*1", cell="input").problem == ""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("=q.cart*100", 50.0),
        ("=v.cart*3 - 2*v.pole", 8.0),
        ('=v["two arms"][1]*kick', 1.2),
        ("=2*v.ball[2]", 6.0),
        ("=out.tilt*4", 1.0),
        ("=5*q.nut", 3.5),
        ("=t + 1", 1.0),
        ("=if(v.cart > 1, kick, 0)", 3.0),
    ],
)
def test_the_value_is_that_of_the_pose_shown(model, text, value):
    found = hint(model, text)
    assert found.problem == ""
    assert found.unit == "N"
    assert float(found.value.split()[0]) == pytest.approx(value, rel=1e-6)


def test_in_a_run_the_value_is_that_of_the_frame_shown():
    rod = pg.Body(name="rod", axes=[(0, 1, 0)], com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), q=0.3)
    text = "=2*q.rod - v.rod + t"
    model = pg.Model(bodies=[rod], forces=[pg.Motor(name="push", body="rod", torque=text)])
    run = pg.simulate(pg.Mechanism(model), t_end=0.5, frames=6)
    state = ran(begun(model), run)
    for k in (2, 5):
        now = after(state, do.Scrub(ME, float(run.t[k])))
        wanted = 2 * run.q[k, 0] - run.v[k, 0] + run.t[k]
        found = hint(model, text, state=now).value
        assert float(found.split()[0]) == pytest.approx(wanted, rel=1e-5)


@pytest.mark.parametrize(
    ("text", "of", "part", "unit", "parts"),
    [
        ("=q.cart", "push", "forces", "N", ["N", "factor"]),
        ("=q.pole*v.kart", "turn", "forces", "N m", ["kart", "cart"]),
        ("=q.pole + v.pole", "turn", "forces", "N m", ["fit"]),
        ("=out.load*2", "turn", "forces", "N m", ["loop"]),
        ("=1/0", "turn", "forces", "N m", ["zero"]),
        ("=" + "1+" * 2000, "turn", "forces", "N m", ["2000"]),
        ("=" + "(" * 300, "turn", "forces", "N m", ["50"]),
        ("=q.nut", "drive", "constraints", "rad", ["t"]),
        ("=q.pole", "", "switches", "", ["compare"]),
        ("=q.pole > v.cart", "", "switches", "", ["fit"]),
        ("=q.pole", "", "", "", ["varies"]),
        ("=kick/0", "", "", "", ["zero"]),
    ],
)
def test_what_is_wrong_is_said_while_typing(model, text, of, part, unit, parts):
    found = hint(model, text, name=of, part=part, cell="torque" if part == "forces" else "x")
    assert found.unit == unit
    said = found.problem + found.value
    assert all(word in said for word in parts), said


def test_a_condition_is_true_or_false_now(model):
    for text, wanted in (("=q.pole > 0.2 and v.pole < 0", "true"), ("=not q.pole > 0.2", "false")):
        assert hint(model, text, name="", part="switches", cell="holds").value == wanted


def test_other_cells_take_parameters_alone(model):
    assert words(model, "=k", name="", part="") == ["kick"]
    assert words(model, "=q.", name="", part="") == []
    assert hint(model, "=kick/2", name="", part="").value == "1.5"


def test_a_motion_takes_time_alone(model):
    found = {"name": "drive", "part": "constraints", "cell": "expression"}
    assert words(model, "=q.", **found) == []
    assert hint(model, "=0.7 + 2*t", **found).value == "0.7 rad"


@pytest.mark.parametrize(
    ("part", "name", "rate", "text"),
    [
        ("bodies", "pole", False, "q.pole"),
        ("bodies", "pole", True, "v.pole"),
        ("bodies", "two arms", False, 'q["two arms"][0]'),
        ("bodies", "ball", False, "v.ball[0]"),
        ("outputs", "tilt", False, "out.tilt"),
        ("bodies", "plate", False, ""),
        ("outputs", "load", False, ""),
        ("forces", "hold", False, "f.hold"),
        ("forces", "wind", False, ""),
        ("bodies", "gone", False, ""),
    ],
)
def test_what_is_clicked_is_put_into_the_expression(model, part, name, rate, text):
    cell = {"of": "forces", "owner": "push", "cell": "torque"}
    state = after(begun(model), do.PickSignal(ME, 4, part, name, rate, **cell))
    found = state.clients[ME].hint
    assert found.put == text
    assert bool(found.problem) == (not text)
    assert state.model is model


def test_what_would_close_a_loop_is_not_put_into_the_expression(model):
    """The signal of the edited force itself, of one that follows from it, and of a contact."""
    model = model.edit("turn", torque="=0.5*f.push")
    controls = [pg.Sampled(name="load", update="=t", sample=0.1)]
    state = begun(model.replace(controls=controls))
    own = {"of": "forces", "owner": "push", "cell": "torque"}
    for part, name, path in (
        ("forces", "push", "f.push -> f.push"), ("forces", "turn", "f.turn -> f.push -> f.turn"),
        ("contacts", "foot", "force.foot -> "),
    ):  # fmt: skip
        found = after(state, do.PickSignal(ME, 4, part, name, False, **own)).clients[ME].hint
        assert not found.put
        assert path in found.problem
        typed = f"=2*{'force' if part == 'contacts' else 'f'}.{name}"
        assert path in hint(model, typed, state=state).problem
    sampled = {"of": "controls", "owner": "load", "cell": "update"}
    for part, name, text in (("forces", "push", "f.push"), ("contacts", "foot", "force.foot")):
        found = after(state, do.PickSignal(ME, 4, part, name, False, **sampled)).clients[ME].hint
        assert (found.put, found.problem) == (text, "")


def test_the_form_takes_what_the_hint_accepts(model):
    """Cells of every part that varies take an expression, and keep it as it is written."""
    state = begun(model)
    for part, name, field, index, text in (
        ("forces", "push", "torque", (), "=-2*v.cart"),
        ("forces", "hold", "target", (), "=0.1*sin(t)"),
        ("forces", "wind", "force", (1,), "=-v.cart*3"),
        ("constraints", "drive", "expression", (), "=0.7 + 2*sin(t)"),
    ):
        state = after(state, do.EditPart(ME, 1, part, name, field, ((index, text),)))
        assert state.clients[ME].reply.text == ""
        assert text in state.model.to_json()
    assert after(state, *[do.Undo(ME)] * 4).model == model


def test_a_motion_becomes_an_expression_and_back(model):
    edit = lambda field, text: do.EditPart(ME, 1, "constraints", "drive", field, (((), text),))  # noqa: E731
    state = after(begun(model), edit("curve", "sine"), edit("curve", "expression"))
    assert state.model.constraints[0].q_of_t == "=0.0 + 0*t"
    assert after(state, edit("curve", "polynomial")).model.constraints[0].q_of_t.kind

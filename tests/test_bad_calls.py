"""Bad arguments: a refusal names the argument, the value given and what is allowed."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli import main
from pgraph_core.errors import shown
from tests.refusals import assert_names, assert_problems, refusal

NAN, INF = math.nan, math.inf
BASE = pg.Model.serial(3)
BEFORE = BASE.to_json()


BALL = {"kind": "sphere", "radius": 0.1}
SPRING = pg.Spring(name="s", body="1", stiffness=1.0)
TWO = pg.Model(
    bodies=(
        pg.Body(name="arm", axes=(0, 1, 0), com=(0.25, 0, 0), shape=BALL),
        pg.Body(name="fore", parent="arm", axes=(0, 1, 0), com=(0.25, 0, 0), link=(0.5, 0, 0)),
    ),
    constraints=(pg.Point(name="tie", body="fore", active=False),),
    contacts=(pg.Contact(name="tie", body="arm"), pg.Contact(name="floor", body="arm")),
    forces=(pg.Servo(name="drive", body="arm", kp=10.0, kd=1.0),),
    scenarios=(pg.Scenario(name="start", q={"arm": 1.0}, t_end=0.1),),
)  # fmt: skip
PUSHED = BASE.add(pg.Motor("push", body="1"))
MECH = pg.Mechanism(BASE)
BOX = pg.Mechanism(
    pg.Model(
        bodies=[pg.Body(name="box", joint="free", shape=BALL)],
        contacts=[pg.Contact(name="floor", body="box")],
    )
)
HINGES = pg.Mechanism(pg.Model.serial(2))
TOP = pg.Mechanism(pg.Model(bodies=(pg.Body(name="top", joint="spherical"),)))
STILL = pg.Body(name="needle", parent="arm", mass=0.0, inertia=np.zeros((3, 3)))
NEEDLE = pg.Mechanism(pg.Model(bodies=(pg.Body(name="arm"), STILL)))
Q, V = MECH.home()
EVERY = "1, 2, 3"


def run(**options: Any) -> pg.Result:
    return pg.simulate(MECH, **{"t_end": 0.01, "step": 1e-3, **options})


def sweep(path: Any, values: Any = (0.1, 0.2), metric: Any = "final arm", **options: Any) -> Any:
    return pg.sweep(TWO, {path: values}, metric, workers=1, **{"t_end": 0.01, **options})


def batch(path: Any, values: Any, **options: Any) -> Any:
    return pg.BatchStepper(TWO, 2, set={path: values}, **options)


EDITS = [
    (lambda: BASE.edit("1", name="2"), "body '1', name", "'2'", "row 2"),
    (lambda: BASE.edit("1", parent="3"), "body '1', parent", "1 -> 3 -> 2 -> 1", "ground"),
    (lambda: BASE.edit("1", masss=1), "body '1', masss", "did you mean mass?", "dof"),
    (lambda: BASE.edit("1", length=2.0), "com, inertia"),
    (lambda: BASE.edit("1", "mass", 3.0), "Model.edit", "**changes"),
    (lambda: BASE.edit(BASE["1"], mass=2), "'1'"),
    (lambda: BASE.edit(name="1"), "name"),
    *(
        (lambda name=name: getattr(BASE, name)("9"), "body '9'", EVERY)
        for name in ("body", "edit", "remove", "mirror", "duplicate")
    ),
    (lambda: BASE.edit_all({"1": {"mass": 2.0}, "2": {"mass": -1.0}}), "body '2', mass", "-1"),
    (lambda: BASE.mirror("1", plane="w"), "body '1', plane", "'x'", "'y'", "'z'", "'w'"),
    (lambda: BASE.move(["1", "2"], 2), "body '1', to", "0 to 1", "2"),
    (lambda: BASE.remove(["1"], children="keep"), "body '1', children", "'attach'", "'delete'"),
    (lambda: BASE.scenario("swing"), "scenario 'swing'"),
    (lambda: BASE.close_loop("3", "1", joint="planar"), "body '3', joint", "planar", "revolute"),
    (lambda: BASE.close_loop("3", "9"), "constraint '3-9', other", "'9'", EVERY),
    (lambda: TWO.edit("tie", active=False), "'tie'", 'kind="constraint"', 'kind="contact"'),
    (lambda: TWO.edit("drve", kp=1), "'drve'", "choose one of drive, "),
    (lambda: TWO.edit("drive", kind="contact", friction=1), "contact 'drive'", "tie, floor"),
    (lambda: TWO.add({"name": "x"}), "Force, Scenario, Site, Output or Control", "dict"),
    (lambda: TWO.add(pg.Motor), "pg.Motor(name="),
    (lambda: TWO.add(pg.Motor(name="drive", body="arm")), "force 'drive', name"),
    (lambda: TWO.add(pg.Motor(name="x", body="arm"), after="tie"), "force 'tie'", "drive"),
    (lambda: TWO.add(pg.Site(name="arm", body="fore")), "'arm'"),
    (lambda: pg.Force(name="f", kind="sprng", body="a"), "force 'f', kind", "'sprng'", "spring"),
    (lambda: pg.Spring(name="f", kind="motor", body="a"), "'spring'", "'motor'", "a Motor"),
    (lambda: pg.Spring(stiffness=1.0), "pg.Spring(", "body"),
    (lambda: pg.Body("a", "b", "free"), "pg.Body", "name", "first", "parent"),
    (lambda: pg.Model(BASE.bodies, BASE.forces), "pg.Model", "bodies", "first", "forces"),
    (lambda: pg.Ground(True), "pg.Ground", "slope"),
    (lambda: pg.Model(constraints=[SPRING]), "force 's'", "no body is named '1'"),
    (lambda: pg.Body(name="a", com=("=l", 0, 0)), "body 'a', com", "model.edit(name"),
    (lambda: pg.Body(name="a", rotation=np.eye(3)), "body 'a', rotation", "as_quat(scalar_first"),
    (lambda: setattr(BASE.bodies[0], "masss", 0), "did you mean mass"),
    (lambda: setattr(BASE.bodies[0], "mass", 2.0), "body '1', mass", "model.edit('1', mass=2.0)"),
    (lambda: setattr(BASE, "name", "other"), "name", "model.replace(name='other')"),
    (lambda: TWO["start"].q.update(arm=1), "model.edit(name of the part"),
    *((lambda n=n: pg.Model.serial(n), ">= 1", shown(n)) for n in (0, 1.0, "3", True)),
]  # fmt: skip

CALLS = [
    (lambda: TOP.mass_matrix(np.zeros(4)), "q", "quaternion"),
    (lambda: MECH.forward_dynamics(Q, V, ctrl=V), "ctrl", "did you mean tau?"),
    (lambda: MECH.forward_dynamics(Q, V, external=np.ones((2, 6))), "external", "(3, 6)", "(2, 6)"),
    (lambda: MECH.forward_dynamics(Q, V, external=np.full((3, 6), INF)), "external", "finite"),
    (lambda: NEEDLE.forward_dynamics([0, 0], [0, 0]), "'needle', inertia"),
    (lambda: MECH.external_at(Q, "3", [1, 2, 3]), "wrench", "(6,)", "(3,)", "[torque, force]"),
    (lambda: MECH.jacobian(Q, "4"), "'4'", EVERY),
    (lambda: MECH.jacobian(Q, "3", (0, 0)), "point", "3", "2"),
    (lambda: MECH.mobility(active="loop"), "['loop']"),
    (lambda: MECH.assemble(hold="1"), "hold", "q, v, active"),
    (lambda: run(tau=lambda t, q, v: np.zeros(4)), "tau", "3", "4"),
    (lambda: run(method="euler"), "did you mean semi_implicit_euler?"),
    (lambda: run(method="rk4", rtol=1e-8), "rtol", "dop853"),
    (lambda: run(method="rk4", max_steps=5), "10 steps", "0.001 s"),
    (lambda: run(rtol=1e-17), "simulate, rtol", "rounding", "1e-17"),
    (lambda: run(stabilise="hope"), "simulate, stabilise", "project"),
    (lambda: run(estimate="no"), "simulate, estimate", "True, False or None", "'no'"),
    (lambda: run(frames=10**12), "simulate, frames", "100000000", "1000000000000"),
    (lambda: run(frames=1e9), "simulate, frames", "100000000", "1000000000.0"),
    (lambda: run(frames=3, t_eval=[0]), "frames", "t_eval"),
    (lambda: run(step=1e-300), "simulate, step", "1e-300"),
    (lambda: run(t_end=-1.0), "simulate, t_end", "> 0", "-1"),
    (lambda: run(tend=1.0), "tend", "did you mean t_end?"),
    (lambda: run(max_step=0.01), "simulate, max_step", "largest step", "step=0.01, rtol=1e-8"),
    (lambda: run(method=5), "simulate, method", "5", "dop853", "moreau_jean"),
    (lambda: run(t_end=np.timedelta64(1, "s")), "simulate, t_end", "> 0", "timedelta64(1"),
    (lambda: run(t_eval=np.array([0, 1], "timedelta64[ns]")), "t_eval", "times [s]", "nanoseconds"),
    (lambda: pg.simulate(TWO, scenario=TWO.scenario("start")), "scenario", "name", "'start'"),
    (lambda: pg.joined(run()), "joined, runs", "pg.joined([first, second])"),
    (lambda: pg.joined([run(t_start=0.01, t_end=0.02), run()]), "joined, runs", "earlier run"),
    (lambda: sweep("bodies.arm.mass", estimate="no"), "sweep, estimate", "True, False", "'no'"),
    (lambda: BOX.equilibrium(), "equilibrium, q", "9.81", "'box'", "Contacts do not act"),
    (lambda: run(method="moreau_jean"), "moreau_jean", "'auto'", "'semi_implicit_euler'"),
    (lambda: run(t_start=NAN), "t_start", "nan"),
    (lambda: run(t_start=2.0, t_end=1.0), "t_end", "t_start = 2", "1.0"),
    (lambda: run(t_start=1.0, t_end=2.0, t_eval=[0.5]), "t_eval", "1 to t_end = 2"),
    (lambda: run(t_eval=[0.0, 0.0]), "t_eval", "ascend", "got [0.0, 0.0]"),
    (lambda: run(t_eval=3), "t_eval", "list of finite times", "got 3"),
    (lambda: run(t_end=1e12), "simulate, t_end", "1e+09 s", "got 1e+12"),
    (lambda: pg.Scenario(name="a", step="1 ms"), "step", "a number in [s]", "'1 ms'"),
    (lambda: pg.optimise(BASE, "max 1", {"gravity.2": (-20, 0)}, most=1.5), "most", ">= 1", "1.5"),
    (lambda: pg.optimise(BASE, "max 1", {"gravity.2": (-20, 0)}, seed=-1), "seed", ">= 0", "-1"),
    (lambda: pg.optimise(BASE, "max 1", {"gravity.2": (-20, 0)}, tol=0), "tol", "> 0", "got 0"),
    (lambda: run(wrt=3), "simulate, wrt", "str or sequence of str", "got 3"),
    (lambda: run(gravity=0), "simulate, gravity"),
    (lambda: run(progress=3), "simulate, progress", "function", "got 3"),
    (lambda: run(progress=lambda: None), "progress", "fraction"),
    (lambda: run(events=lambda t, q, v: q[0] > 1), "crosses zero"),
    (lambda: run(forces=5), "simulate, forces", "pg.Force", "got 5"),
    (lambda: run(forces=[pg.Motor(name="z", body="1", coordinate=1)]), "force 'z', coordinate"),
    (lambda: pg.simulate(BASE, 0.5), "t_end=0.5"),
    (lambda: pg.simulate("arm.json"), "pg.load('arm.json')"),
    (lambda: pg.simulate("pendulum"), "pg.load('pendulum')"),
    (lambda: pg.simulate(BASE.to_json()), "pg.Model.from_json(text)"),
    *(
        (lambda names=names, call=call: call(
            TWO, scenario="start", forces=[pg.Servo(name=n, body="fore", kp=1.0) for n in names]
        ), repr(names[0]))
        for names in (("drive",), ("new", "new")) for call in (pg.simulate, pg.Stepper)
    ),
    (lambda: pg.Stepper(MECH, h=1e-3), "Stepper", "h", "did you mean step?"),
    (lambda: pg.Stepper(MECH, 1e-3), "Stepper", "positional", "(mechanism, *, step,"),
    (lambda: pg.Stepper(MECH).record_over(-1.0), "dt", "> 0", "-1"),
    (lambda: pg.Stepper(HINGES).step(lambda t, q, v: v), "pg.Stepper(..., tau=function)"),
    (lambda: pg.Stepper(HINGES).step({"1": "x"}), "tau", "numbers"),
    (lambda: pg.Stepper(TWO).inputs.__setitem__("drive", 2.0), "st.step"),
    (lambda: pg.BatchStepper(HINGES, 2).step([1.0]), "(2, 2)", "(2,)"),
    (lambda: pg.BatchStepper(HINGES, 2).reset(numbers=1), "numbers", "set"),
    (lambda: batch("bodies.arm.q.0", [0.1, 0.9], scenario="start"), "scenario 'start'"),
    (lambda: sweep("bodies.arm.q.0", q=[0.0, 0.0]), "bodies.arm.q.0", "q= of the call"),
    (lambda: sweep("bodies.arm.q.0", scenario="start"), "bodies.arm.q.0", "scenario 'start'"),
    (lambda: sweep("scenarios.start.q.arm.0", scenario="start", q=[0.0, 0.0]), "q= of the call"),
    (lambda: sweep("forces.drive.target", inputs={"drive": 0.5}), "inputs['drive']"),
    (lambda: sweep("scenarios.start.t_end", scenario="start", t_end=0.05), "t_end=0.05"),
    (lambda: sweep("scenarios.start.t_end"), "scenario='start'"),
    (lambda: sweep("bodies.arm.mass", metric=[lambda r: 1.0, lambda r: 2.0]), "'<lambda>'"),
    (lambda: pg.write_urdf(BASE, "u.txt"), ".urdf"),
    (lambda: pgraph_models.path("horse"), "'horse'", *pgraph_models.names()),
    (lambda: pg.underfoot(BASE, friction=-1), "friction"),
    (lambda: pg.Model.edit("a", mass=1.0), "Model.edit", "Model"),
    (lambda: pg.Result(), "Result", "mechanism"),
    *(
        (lambda p=p: pg.pgraph_of(p), *facts)
        for p, *facts in (
            ([0, 3, 2], "body 2, parent", "cycle"), ([0, 5], "body 2, parent", "0 to 2", "5"),
            ([0.0, 1.0], "parent"), ([[0], [0, 1]], "parent"), (None, "parent"),
        )
    ),
    (lambda: pg.parent_of([1, 2, 5]), "pgraph", "1 to 3", "[1, 2, 5]"),
    (lambda: pg.jdof_of([1, 2, 1, 3], [1, 1]), "dof", "3", "2"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "facts"), [(call, facts) for call, *facts in EDITS + CALLS])
def test_a_refused_call_names_the_argument_and_what_would_do(call, facts):
    before = TWO.to_json()
    text = str(refusal(call))
    assert_names(text, *facts)
    assert (BASE.to_json(), TWO.to_json()) == (BEFORE, before)


@cache
def recorded() -> pg.Result:
    return pg.simulate(BASE, t_end=0.01, frames=3)


def test_an_attribute_that_nothing_reads_is_refused():
    stepper, lanes = pg.Stepper(BASE), pg.BatchStepper(MECH, 2)
    for value, names in (
        (MECH, ("gravity", "q", "nq", "nonsense")),
        (stepper, ("dt", "q", "tau", "status", "gravity")),
        (lanes, ("q", "step_size", "threads")),
        (recorded(), ("q",)),
    ):
        for name in names:
            with pytest.raises(pg.InputError, match=f"{type(value).__name__}, {name}: ") as found:
                setattr(value, name, 1)
            assert isinstance(found.value, AttributeError)

    class Robot(pg.Mechanism):
        def __init__(self, model):
            self.early = 2.0
            super().__init__(model)
            self.gain = 3.0

    assert (Robot(BASE).early, Robot(BASE).gain) == (2.0, 3.0)


def test_a_name_that_results_lack_is_a_key_error():
    done = pg.simulate(TWO, t_end=0.01, step=1e-3)
    for found in (done.contact_force, done.contact_gap, pg.Stepper(TWO).contact_force):
        with pytest.raises(KeyError, match=r"'flor'.*floor") as missing:
            found["flor"]
        assert isinstance(missing.value, pg.InputError)


def test_an_error_of_the_user_s_own_function_comes_through_as_it_is():
    with pytest.raises(KeyError, match="not there") as raised:
        run(progress=lambda fraction: {}["not there"])
    assert not isinstance(raised.value, pg.PgraphError)


ROD = {"com": (0.5, 0, 0), "inertia": ((0.01, 0, 0), (0, 0.1, 0), (0, 0, 0.1))}


def linkage(**pin: Any) -> pg.Model:
    """Rods of 1 and 1 m from a hinge at the origin, their end pinned."""
    a, b = pg.Body(name="a", **ROD), pg.Body(name="b", parent="a", link=(1, 0, 0), **ROD)
    c = pg.Constraint(**{"name": "pin", "body": "b", "point": (1, 0, 0), **pin})
    return pg.Model(up="y", bodies=(a, b), constraints=(c,))


def held(kind: str, **values: Any) -> pg.Model:
    """One rod whose joint several constraints prescribe."""
    parts = [
        pg.Motion(name=name, body="a", q_of_t={"t": (0, 1), "value": (value, value)})
        if kind == "motion"
        else pg.Velocity(name=name, body="a", value=value, coefficients={"a": 1.0})
        for name, value in values.items()
    ]
    return pg.Model(up="y", bodies=(pg.Body(name="a", **ROD),), constraints=parts)


@pytest.mark.parametrize(
    ("model", "facts"),
    [
        (linkage(other_point=(3, 0, 0)), ("constraint 'pin'", "by 1 m")),
        (linkage(kind="distance", other_point=(0, 0, 0), length=2.5), ("'pin'", "by 0.5 m")),
        (held("motion", left=0.2, right=0.5), ("constraint 'right'", "'left'", "by 0.15 rad")),
        (held("velocity", slow=1.0, fast=2.0), ("constraint 'fast'", "'slow'", "by 0.5 rad/s")),
    ],
)
def test_constraints_that_cannot_be_met_are_named_with_their_gap(model, facts):
    """By `assemble`, and as the end of a run."""
    mech = pg.Mechanism(model)
    error = str(refusal(mech.assemble, pg.InputError))
    assert_names(error, *facts)
    done = pg.simulate(mech, t_end=0.1)
    assert done.status is pg.Status.CANNOT_CLOSE
    assert error in done.message


def test_velocities_that_a_switch_contradicts_end_the_run():
    switches = ((0.0, "fast", False), (0.1, "fast", True))
    model = held("velocity", slow=1.0, fast=2.0)
    done = pg.simulate(model, t_end=0.2, switches=switches, estimate=False)
    assert_names(done.message, "constraint 'fast'", "0.1 s", "0.5")


def test_a_loop_that_does_not_close_names_joints_left_at_the_parents_origin():
    turn = {"axes": (0, 0, 1), "tip": (1, 0, 0), "inertia": (0.01,) * 3}
    bodies = [pg.Body(name="a", **turn), pg.Body(name="b", parent="a", **turn)]
    far = pg.Point(name="far", body="b", point=(0.2, 0, 0), other_point=(1.1, 0, 0))
    model = pg.Model(bodies=bodies, constraints=[far])
    with pytest.raises(pg.InputError, match=r"body 'b': .*link.* tip") as refused:
        pg.Mechanism(model).mobility()
    assert refused.value.problems[0].where == "constraint 'far'"
    assert pg.simulate(model.edit("b", link=(1, 0, 0)), t_end=0.1).status.ok


FEET = ("left_front_foot", "right_front_foot", "left_hind_foot", "right_hind_foot")
QUADRUPED = pg.Model.load(pgraph_models.path("quadruped_hips"))
TROT = pg.gaits()["trot"]


def test_a_gait_names_contacts_of_its_model_and_goes_with_them():
    gait = TROT.edit(feet=[f.model_dump() | {"foot": f"{f.foot}!"} for f in TROT.feet])
    scenario = pg.Scenario(name="walk", gait=gait)
    error = refusal(lambda: QUADRUPED.replace(scenarios=(scenario,)), pg.ModelError)
    assert_problems(error.problems[:1], [("scenario 'walk', gait", "'left_front_foot!'", *FEET)])
    lame = QUADRUPED.remove("left_hind_paw")
    assert all(s.gait is None for s in lame.scenarios)
    assert any("scenario 'trot'" in text for text in lame.notices)


PENDULUM = pg.Mechanism(pg.Model.load(pgraph_models.path("pendulum")))
FEW = [{"foot": foot, "offset": 0.0, "duty": 0.5} for foot in FEET[:3]]


def switch(*given: Any) -> pg.Result:
    return pg.simulate(linkage(), t_end=0.2, switches=(given,))


def walk(model: pg.Model, gait: pg.Gait = TROT) -> pg.Controller:
    return pg.Controller(pg.Mechanism(model), gait)


def study(**given: Any) -> Any:
    return pg.work_precision(PENDULUM, **{"t_end": 1.0, **given})


DURATIONS = np.array([0, 1], dtype="timedelta64[ns]")
CURVE, MASS = {"t": [0.0, 0.1], "1": [0.0, 0.1]}, {"bodies.1.mass": (1.0, 2.0)}
LATE = [
    (lambda: switch(0.1, "pn", True), "simulate, switches: ", "'pn'", "choose one of pin"),
    (lambda: switch(0.3, "pin", False), "'pin'", "0.3 s", "0.2 s"),
    (lambda: switch(-0.1, "pin", False), "t must", ">= 0", "-0.1"),
    (lambda: switch(0.1, "pin", 2), "active", "true or false", "got 2"),
    (lambda: switch(0.1, "pin"), "t, name of a constraint", "pg.Switch(", "[0.1, 'pin']"),
    (lambda: pg.simulate(linkage(), t_end=0.2, switches={"t": 0.1}), "constraint is missing"),
    (lambda: pg.simulate(TWO, friction=0.3), "pg.Contact(", "pg.Ground(", "pg.Body(", "pg.Tendon("),
    (lambda: run(record=["q"]), "simulate, record", "every quantity", "frames", "stepper.record"),
    (lambda: run(wrt=["gravity"]), "simulate, gravity", "gravity.0", "-9.81"),
    (lambda: run(wrt=["gravity.z"]), "simulate, gravity.z", "x, y and z", "here 2"),
    (lambda: run(wrt=["ground"]), "simulate, ground", "one of its numbers, as in ground."),
    (lambda: run(wrt=["bodies.2.inertia"]), "as in bodies.2.inertia.0.0"),
    (lambda: run(wrt=["bodies.2"]), "as in bodies.2.mass"),
    (lambda: run(wrt=["q"]), "simulate, q:", "moving joint", "as in q.1"),
    (lambda: run(wrt=["v.4"]), "simulate, v.4", "'4'", EVERY),
    (lambda: pg.sweep(BASE, {"q": [0, 1]}, "max 1"), "sweep, q:", "as in q.1"),
    (lambda: pg.sweep(BASE, {"q.4": [0, 1]}, "max 1"), "sweep, q.4", "'4'", EVERY),
    (lambda: pg.optimise(BASE, "max 1", {"q": (0, 1)}), "optimise, q:", "as in q.1"),
    (lambda: pg.BatchStepper(PUSHED, 2).step(inputs={"push": 1}), "batch.step({", "batch.target("),
    (lambda: pg.BatchStepper(PUSHED, 2).target("push", 1), "'push'", "batch.step({'1': values})"),
    (lambda: pg.Stepper(PUSHED).target("push", 1), "'push'", "stepper.input('push', value)"),
    (lambda: pg.Output("o", kind="pos", at="1"), "output 'o', kind", "'pos'", "mean position?"),
    (lambda: pg.Output("o", kind="giro", at="1"), "output 'o', kind", "'giro'", "mean gyro?"),
    (lambda: pg.sweep(BASE, {"q.1": [0]}, "max 1", samples="gird"), "'gird'", "mean grid?"),
    (lambda: pg.Gait(name="g", feet=FEW), "gait 'g', feet", "four", repr(list(FEET[:3]))),
    (lambda: TROT.edit(feet=[*FEW, FEW[0]]), "gait 'trot', feet", "'left_front_foot'", "twice"),
    (lambda: TROT.edit(sway=(0.1,)), "gait 'trot', sway", "pairs", "[0.1]"),
    (lambda: walk(QUADRUPED.replace(scenarios=(), contacts=())), "'left_front_foot'", "no contact"),
    (lambda: walk(pg.Model.serial(3)), "gait 'trot'", "'y'", "'z'"),
    (lambda: walk(QUADRUPED.edit("pelvis", joint="weld")), "gait 'trot'", "free", "'pelvis'"),
    (lambda: walk(QUADRUPED.edit("left_radius", joint="weld")), "'left_front_foot'"),
    (lambda: walk(QUADRUPED, TROT.edit(speed=9.0)), "trot', speed", "9 m/s", "0.38 s", "0.5"),
    (lambda: walk(QUADRUPED, TROT.edit(height=0.7)), "gait 'trot', height", "0.7 m", "hip"),
    (lambda: study(methods=("rk4", "rk5")), "work_precision, methods", "'rk5'", "rk4", "radau5"),
    (lambda: study(steps=(0.1, -1)), "work_precision, steps", "1e-08 and 1", "(0.1, -1)"),
    (lambda: study(tolerances=1e-17), "work_precision, tolerances", "8.88178e-16 and 0.1", "1e-17"),
    (lambda: study(tolerances=[10.0**-k for k in range(70)]), "tolerances", "70", "64"),
    (lambda: study(frames=2.5), "work_precision, frames", ">= 3", "2.5"),
    (lambda: pg.fit(BASE, CURVE, MASS, foo=1), "fit, foo", "sigma", "priors", "rtol"),
    (lambda: pg.optimise(BASE, "max 1", MASS, foo=1), "optimise, foo", "subject_to", "rtol"),
    (lambda: pg.optimise(BASE, "max u", MASS, t_end=0.01), "optimise, objective", "'u'", EVERY),
    (lambda: pg.optimise(BASE, lambda r: "a", MASS, t_end=0.01), "optimise, objective", "'a'"),
    (lambda: pg.optimise(BASE, "max 1", MASS, history="/no/h"), "history", "/no/h", "folder"),
    (lambda: pg.fit(BASE, CURVE, ["bodies.1.mass"], bounds=(1, 2)), "fit, bounds", 'free={"'),
    (lambda: pg.optimise(BASE, "max 1", MASS, maxiter=3), "optimise, maxiter", "mean most?"),
    (lambda: pg.optimise(PUSHED, "rms u.push", MASS, t_end=0.01), "mean drive_force.push?"),
    (lambda: pg.optimise(PUSHED, "peak torque", MASS, t_end=0.01), "mean drive_force.push"),
    (lambda: pg.simulate(BOX, t_end=0.01)["box.7"], "'box.7'", "box.0, box.1", "box.6"),
    (lambda: pg.simulate(BOX, t_end=0.01)["q.bx"], "'q.bx'", "box.0"),
    (lambda: run().contact_force["x"], "'x'", "model.add(pg.Contact("),
    (lambda: run().outputs["x"], "'x'", "model.add(pg.Output("),
    (lambda: run(q=[0.1]), "simulate, q", "(3,)", "(1,)", EVERY, "q={'1': ...}"),
    (lambda: run(tau=[0.1]), "simulate, tau", "(3,)", "(1,)", EVERY, "tau={'1': ...}"),
    (lambda: MECH.mass_matrix([0.1]), "q", "(3,)", "(1,)", EVERY),
    (lambda: BOX.forward_dynamics(BOX.home()[0], [1.0]), "v", "(6,)", "box (6)"),
    (lambda: pg.Stepper(MECH).reset(v=[0.1]), "v", "(3,)", "(1,)", EVERY),
    (lambda: pg.Stepper(MECH).step([0.1]), "tau", "(3,)", "(1,)", EVERY),
    (lambda: pg.Stepper(MECH).step(1e-3), "pg.Stepper(..., step=0.001)", "step(n=10)"),
    (lambda: pg.simulate_batch(MECH, q=np.zeros((2, 2)), t_end=0.01), "q", "(2, 2)", EVERY),
    (lambda: pg.simulate(BOX, v={"box": (1, 0, 0)}), "v['box']", "6", "got 3", "'linear'"),
    (lambda: pg.simulate(BOX, q={"box.2": 1.0}), "'box.2'", "'position'", "'rotation'"),
    (lambda: pg.Body("b", joint="free", v=(0, 0, 1)), "body 'b', v", "6", "got 3", "'linear'"),
    (lambda: pg.fit(BASE, CURVE, MASS, n=3), "fit, n", "pg.sweep(..., n=...)", "starts"),
    (lambda: pg.fit(BASE, {**CURVE, "t": DURATIONS}, MASS), "data['t']", "numbers", "seconds"),
    (lambda: study(reference=3.0), "Result", "Case", "Reference", "(len(t), 1)", "float"),
]


@pytest.mark.parametrize(
    ("call", "mistyped", "meant"),
    [
        (lambda: pg.BatchStepper(PUSHED, 2).record, "record", "mean trace?"),
        (lambda: pg.BatchStepper(PUSHED, 2).input, "input", "batch.step({"),
        (lambda: TWO.arm, "arm", "model['arm']"),
    ],
)
def test_an_attribute_is_answered_with_what_works_on_this_object(call, mistyped, meant):
    assert_names(str(refusal(call, AttributeError)), f"'{mistyped}'", meant)


def test_a_field_of_several_parts_names_those_of_the_model_first():
    for model, order in ((TWO, ("Contact", "Ground", "Body")), (BASE, ("Body", "Contact"))):
        text = str(refusal(lambda model=model: pg.simulate(model, friction=0.3)))
        places = [text.index(f"pg.{kind}(..., friction=") for kind in order]
        assert places == sorted(places), text


def test_a_failing_objective_is_told_what_it_receives():
    error = refusal(lambda: pg.optimise(BASE, lambda x: x[0] ** 2, MASS, t_end=0.01))
    assert_names("\n".join(error.__notes__), "objective", "pg.Result")


def test_switches_are_taken_as_scenarios_write_them():
    fields = {"constraint": "pin", "active": False, "t": 0.1}
    runs = [
        pg.simulate(linkage(), t_end=0.2, switches=given)
        for given in ([(0.1, "pin", False)], [fields], fields, [pg.Switch(**fields)])
    ]
    assert all(np.array_equal(each.q, runs[0].q) for each in runs)


@pytest.mark.parametrize(("call", "facts"), [(call, facts) for call, *facts in LATE])
def test_a_switch_a_gait_or_a_study_that_does_not_fit_is_refused(call, facts):
    assert_names(str(refusal(call)), *facts)


def test_a_target_that_no_method_reaches_is_answered_with_the_best(tmp_path):
    given = {"methods": "rk4", "steps": [0.1, 1e-2, 1e-8], "rounds": 1, "target": 1e-12}
    study = pg.work_precision(PENDULUM, t_end=0.2, longest=20, **given)
    best = min((row for row in study.rows if row.error), key=lambda row: row.error)
    facts = ("recommend, target", "1e-12", f"{best.error:.2g}", "rk4", f"{best.step:g} s")
    error = str(refusal(study.recommend, pg.InputError))
    assert_names(error, *facts)
    assert "1 run " in study.answer  # was left out
    assert "`longest`" in study.answer
    error = str(refusal(lambda: study.save(tmp_path / "a.pdf"), pg.FileError))
    assert_names(error, "a.pdf", ".html, .json, .svg, .txt")


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        ([], ("MODEL", "--case")),
        (["pendulum", "-o", "a.pdf"], ("a.pdf", ".html, .json, .svg, .txt")),
        (["--case", "none"], ("case 'none'", "a01")),
        (["pendulum", "--methods", "rk5"], ("work_precision, methods", "'rk5'")),
    ],
)
def test_words_after_pgraph_report_are_refused(capsys, words, facts):
    assert main(["report", *words]) == 1
    assert_names(capsys.readouterr().err, *facts)
    with pytest.raises(SystemExit):
        main(["report", "pendulum", "--steps", "a,b"])
    assert "'a,b'" in capsys.readouterr().err

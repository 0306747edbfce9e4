"""Muscles beside OpenSim and MuJoCo, and the laws that hold for each of them."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import pgraph_core as pg
from pgraph_core.muscles import MODELS
from tests.refusals import assert_names, refusal

MODELS_OF_MUSCLES = [*MODELS]
ELASTIC = ["degroote2016", "thelen2003", "millard2012"]


def on_slider(length: float, speed: float = 0.0, **muscle: Any) -> pg.Mechanism:
    """A heavy block that slides along x, and a muscle from the ground to it."""
    given = {"f_max": 500.0, "l_opt": 0.1, "l_slack": 0.15, "excitation": 0.3, **muscle}
    block = pg.Body(
        name="block", joint="prismatic", axes=((1, 0, 0),), q=(length,), v=(speed,), mass=50.0
    )
    muscles = [pg.Muscle(name="m", body="block", point=(0, 0, 0), other="ground", **given)]
    return pg.Mechanism(pg.Model(gravity=(0, 0, 0), bodies=[block], forces=muscles))


def reach(joint_friction: float = 0.0, **muscle: Any) -> pg.Mechanism:
    """A forearm that swings under gravity, with a flexor."""
    given = {"f_max": 600.0, "l_opt": 0.12, "l_slack": 0.18, "excitation": 0.3, **muscle}
    inertia = np.eye(3) * 0.01
    arm = pg.Body(name="arm", axes=((0, 1, 0),), mass=2, com=(0, 0, -0.15), inertia=inertia)
    fore = pg.Body(
        name="fore", parent="arm", link=(0, 0, -0.3), axes=((0, 1, 0),), q=(-0.8,), mass=1,
        com=(0, 0, -0.15), inertia=inertia, tip=(0, 0, -0.3), friction=joint_friction,
    )  # fmt: skip
    flexor = pg.Muscle(
        name="flexor", body="fore", point=(0.02, 0, -0.04), other="arm", other_point=(0.03, 0, 0),
        **given,
    )  # fmt: skip
    return pg.Mechanism(pg.Model(bodies=[arm, fore], forces=[flexor]))


def held(**muscle: Any) -> pg.Model:
    """A hanging arm with a flexor from above its joint."""
    given = {"f_max": 300.0, "l_opt": 0.15, "l_slack": 0.1, **muscle}
    arm = pg.Body(
        name="arm", axes=[(0, 1, 0)], q=(0.5,), mass=1, com=(0, 0, -0.2), inertia=(0.02, 0.02, 0.01)
    )  # fmt: skip
    flexor = pg.Muscle(
        name="flexor", body="arm", point=(0, 0, -0.1), other_point=(0.05, 0, 0.15), **given
    )
    return pg.Model(bodies=[arm], forces=[flexor])


def at_once(mech: pg.Mechanism) -> pg.Result:
    return mech.simulate(t_end=1e-3, method="dop853", frames=2)


THELEN = {
    "tendon_strain": 0.033, "active_width": 0.5, "passive_shape": 4.0, "shortening": 0.3,
    "lengthening": 1.8,
}  # fmt: skip
# arm26 of OpenSim with the elbow at 90 degrees, by OpenSim 4.6: f_max, l_opt, l_slack, pennation,
# length of the path; then tendon force and length of the fibre for an activation
ARM26 = {
    "TRIlat": (
        (624.3, 0.1138, 0.098, 0.15707963, 0.201264683),
        {
            0.05: (30.293821, 0.103923823),
            0.5: (301.476761, 0.102564356),
            1: (600.851425, 0.101672307),
        },
    ),
    "BICshort": (
        (435.56, 0.1321, 0.1923, 0.0, 0.290768951),
        {
            0.05: (18.887788, 0.096853207),
            0.5: (184.814665, 0.094257112),
            1: (364.656240, 0.092726503),
        },
    ),
    "BRA": (
        (987.26, 0.0858, 0.0535, 0.0, 0.122367456),
        {
            0.05: (45.466259, 0.068402403),
            0.5: (451.422929, 0.067661710),
            1: (898.645090, 0.067194526),
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ARM26)
def test_a_muscle_of_thelen_holds_as_in_opensim(name):
    (f_max, l_opt, l_slack, pennation, length), forces = ARM26[name]
    for a, (force, fibre) in forces.items():
        mech = on_slider(
            length, model="thelen2003", f_max=f_max, l_opt=l_opt, l_slack=l_slack,
            pennation=pennation, shape=THELEN, excitation=float(a),
        )  # fmt: skip
        run = at_once(mech)
        assert run.tension["m"][0] == pytest.approx(force, rel=1e-6)
        assert run["fibre.m"][0] == pytest.approx(fibre, abs=2e-9)
        assert run["activation.m"][0] == a


# gait10dof18musc of OpenSim at an activation of 0.5, by OpenSim 4.6: the same, and its force
GAIT10 = {
    "rect_fem": (1169.0, 0.130462347889869, 0.354766033735608, 0.08726646, 0.491907347, 581.908393),
    "vasti": (5000.0, 0.101374267400811, 0.158470119155291, 0.05235988, 0.248193752, 2262.127247),
    "soleus": (5137.0, 0.05028880287293, 0.25144401436465, 0.43633231, 0.301578878, 2293.465901),
    "hamstrings": (2700.0, 0.12363108064316, 0.369759011831837, 0.0, 0.473781105, 1127.231828),
    "bifemsh": (804.0, 0.191444885177129, 0.0984889871720488, 0.40142573, 0.249956466, 334.355964),
}  # fmt: skip


@pytest.mark.parametrize("name", GAIT10)
def test_a_muscle_of_millard_holds_as_in_opensim(name):
    f_max, l_opt, l_slack, pennation, length, force = GAIT10[name]
    run = at_once(
        on_slider(
            length, model="millard2012", f_max=f_max, l_opt=l_opt, l_slack=l_slack,
            pennation=pennation, excitation=0.5,
        )
    )  # fmt: skip
    assert run.tension["m"][0] == pytest.approx(force, rel=1e-5)


@pytest.mark.parametrize("length", [0.12, 0.16, 0.2, 0.24, 0.29, 0.33])
@pytest.mark.parametrize("speed", [-0.3, -0.05, 0.0, 0.02, 0.2])
def test_the_muscle_of_mujoco_is_that_of_mujoco(length, speed):
    mujoco = pytest.importorskip("mujoco")
    prm = np.array([0.75, 1.05, 500.0, 200.0, 0.5, 1.6, 1.5, 1.3, 1.2, 0.0])
    ends = np.array([0.17, 0.27])
    gain = mujoco.mju_muscleGain(length, speed, ends, 1.0, prm[:9])
    bias = mujoco.mju_muscleBias(length, ends, 1.0, prm[:9])
    l_opt = (ends[1] - ends[0]) / (prm[1] - prm[0])
    mech = on_slider(
        length, speed, model="mujoco", f_max=500.0, l_opt=l_opt, l_slack=ends[0] - prm[0] * l_opt,
        excitation=0.7,
    )  # fmt: skip
    assert at_once(mech).tension["m"][0] == pytest.approx(-(0.7 * gain + bias), abs=500 * 1e-12)


@pytest.mark.parametrize("model", MODELS_OF_MUSCLES)
def test_curves_are_followed_and_go_on_as_lines(model):
    kind = MODELS[model]
    for curve in filter(None, kind.curves(kind.shape)):
        rows = curve.rows(10)
        for k, (a, b) in enumerate(pairwise(curve.places)):
            x = np.linspace(a, b, 501)[1:-1]
            row = np.searchsorted(rows[:, 0], x, "right") - 1
            s = x - rows[row, 0]
            found = sum(rows[row, 1 + n] * s**n for n in range(8))
            exact = curve.value(k, x)
            np.testing.assert_allclose(found, exact, rtol=1e-11, atol=1e-10)
        assert not rows[0, 3:].any()
        assert not rows[-2, 3:].any()


@pytest.mark.parametrize("model", ELASTIC)
def test_curves_have_the_values_that_define_them(model):
    kind = MODELS[model]
    curves = kind.curves(kind.shape)

    def at(curve: Any, x: float) -> float:
        k = min(int(np.searchsorted(curve.places, x, "right")), len(curve.places) - 1) - 1
        return float(curve.value(k, np.array([x]))[0])

    assert at(curves.active, 1.0) == pytest.approx(1.0, abs=2e-3)
    assert at(curves.velocity, 0.0) == pytest.approx(1.0, abs=1e-12)
    assert at(curves.velocity, -1.0) == pytest.approx(0.0, abs=1e-12)
    assert at(curves.passive, 1.0 + kind.shape["passive_strain"]) == pytest.approx(1.0, abs=1e-12)
    strain = kind.shape["tendon_strain"]
    places = min(1.0 + strain, curves.tendon.places[-1])
    slope = (1.0 + strain - places) * kind.shape.get("tendon_stiffness", 0.0) / strain
    assert at(curves.tendon, places) + slope == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("model", MODELS_OF_MUSCLES)
def test_work_of_a_muscle_is_the_change_of_energy(model):
    run = reach(model=model, excitation="=0.4 + 0.3*sin(9*t)").simulate(
        t_end=1.0, method="dop853", rtol=1e-10
    )
    assert run.success
    assert run.energy_drift < 1e-8
    assert abs(run.work[-1]) > 0.1


@pytest.mark.parametrize("model", ELASTIC)
def test_methods_agree(model):
    mech = reach(model=model, excitation="=0.3 + 0.2*sin(7*t)")
    runs = [mech.simulate(t_end=0.5, method=m) for m in ("dop853", "radau5", "gauss6")]
    best = mech.simulate(t_end=0.5, method="dop853", rtol=1e-11)
    for run in runs:
        error = np.abs(run.q[-1] - best.q[-1]).max()
        assert error < 10.0 * run.error_estimate + 1e-11
        assert error < 1e-5


def test_time_stepping_falls_with_the_step():
    mech = reach(excitation="=0.3 + 0.2*sin(7*t)", joint_friction=0.05)
    ends = [
        mech.simulate(t_end=0.1, method="moreau_jean", step=h).q[-1]
        for h in (4e-3, 2e-3, 1e-3, 5e-4)
    ]
    changes = [np.abs(b - a).max() for a, b in pairwise(ends)]
    assert changes[0] > 3.0 * changes[1] > 9.0 * changes[2]


@pytest.mark.parametrize("model", ELASTIC)
def test_a_stiff_tendon_is_nearly_rigid(model):
    runs = [
        reach(model=model, **given).simulate(t_end=0.5, method="radau5", rtol=1e-8)
        for given in ({"tendon": "rigid"}, {"shape": {"tendon_strain": 1e-4}})
    ]
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() < 5e-3


def test_a_muscle_begins_at_rest_in_equilibrium():
    mech = on_slider(0.26, model="millard2012", excitation=0.4)
    run = mech.simulate(t_end=0.05, method="dop853", rtol=1e-10)
    change = np.diff(run["fibre.m"])[0] / np.diff(run.t)[0]
    assert abs(change) < 1e-3


def test_activation_follows_the_excitation():
    mech = on_slider(0.24, model="thelen2003", excitation="=if(t < 0.1, 1, 0)", start=0.01)
    run = mech.simulate(t_end=0.3, method="dop853", rtol=1e-9, frames=301)
    a = run["activation.m"]
    assert a[100] == a.max()
    # rising: a' = (1 - a)/(0.015 (0.5 + 1.5 a)), whose time is known for a given activation
    k = int(np.searchsorted(a[:100], 0.8))
    time = 0.015 * (-1.5 * (a[k] - 0.01) - 2.0 * math.log((1 - a[k]) / 0.99))
    assert run.t[k] == pytest.approx(time, abs=1e-8)
    assert a[-1] == pytest.approx(0.01, abs=0.1)
    assert (a >= 0.01 - 1e-9).all()


def test_excitations_are_inputs_expressions_and_tables():
    table = pg.Table(t=(0.0, 0.2), value=(0.0, 1.0))
    first = reach(excitation="=min(5*t, 1)").simulate(t_end=0.3, method="dop853")
    second = reach(excitation=table).simulate(t_end=0.3, method="dop853")
    third = reach(excitation=0.0).simulate(t_end=0.3, method="dop853", inputs={"flexor": table})
    np.testing.assert_allclose(second.q, first.q, atol=1e-7)
    np.testing.assert_array_equal(third.q, second.q)


def test_a_stepper_sets_an_excitation():
    stepper = pg.Stepper(reach(excitation=0.2), step=1e-3)
    for _ in range(20):
        stepper.step()
    stepper.input("flexor", 0.9)
    assert stepper.inputs["flexor"] == 0.9
    for _ in range(100):
        stepper.step()
    assert 0.8 < stepper.states[0] < 0.9


def test_expressions_read_the_activation():
    mech = reach(excitation="=0.5")
    model = mech.model.replace(
        controls=(pg.Filter(name="slow", input="=x.flexor", lag=0.05, start=0.0),)
    )
    run = pg.Mechanism(model).simulate(t_end=0.4, method="dop853")
    assert run["x.slow"][-1] == pytest.approx(0.5 * (1 - math.exp(-8)), rel=1e-5)
    renamed = model.edit("flexor", kind="force", name="biceps")
    assert renamed.controls[0].input == "=x.biceps"
    assert not model.remove("fore").controls


@pytest.mark.parametrize("model", ELASTIC)
def test_derivatives_of_a_reach_are_those_of_differences(model):
    paths = ["forces.flexor.f_max", "forces.flexor.l_slack", "q.fore", "inputs.flexor"]

    def end(f_max: float = 600.0, l_slack: float = 0.18, q: float = -0.8, u: float = 0.3):
        mech = reach(model=model, f_max=f_max, l_slack=l_slack)
        return mech.simulate(
            t_end=0.2, q={"fore": q}, inputs={"flexor": u}, method="dop853", rtol=1e-11, atol=1e-12
        ).q[-1]

    mech = reach(model=model)
    run = mech.simulate(
        t_end=0.2, inputs={"flexor": 0.3}, method="dop853", rtol=1e-11, atol=1e-12, wrt=paths
    )
    found_slopes = run.gradient(lambda r: r.q[-1])
    for path, name, h in zip(paths, ("f_max", "l_slack", "q", "u"), (0.1, 1e-5, 1e-4, 1e-4)):
        here = {"f_max": 600.0, "l_slack": 0.18, "q": -0.8, "u": 0.3}
        ends = [end(**{**here, name: here[name] + s * h}) for s in (-2, -1, 1, 2)]
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        found = found_slopes[path]
        np.testing.assert_allclose(found, slope, rtol=3e-5, atol=1e-6 * np.abs(slope).max())


def test_runs_go_on_and_are_saved(tmp_path):
    mech = reach(excitation="=0.3 + 0.2*sin(7*t)", model="millard2012")
    whole = mech.simulate(t_end=0.4, method="dop853", rtol=1e-9)
    half = mech.simulate(t_end=0.2, method="dop853", rtol=1e-9)
    rest = mech.simulate(
        t_start=0.2, t_end=0.4, q=half.q[-1], v=half.v[-1], states=half.states[-1],
        method="dop853", rtol=1e-9,
    )  # fmt: skip
    np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=1e-8)
    whole.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again["fibre.flexor"], whole["fibre.flexor"])


REFUSED = {
    "l_opt": {"l_opt": 0.0},
    "f_max": {"f_max": -1.0},
    "l_slack": {"l_slack": 0.0},
    "pennation": {"pennation": math.pi / 2},
    "excitation": {"excitation": 1.5},
    "tendon": {"model": "mujoco", "tendon": "elastic"},
    "shape": {"shape": {"tendon_strian": 0.04}},
}


@pytest.mark.parametrize("field", REFUSED)
def test_wrong_numbers_are_refused_at_their_field(field):
    with pytest.raises(pg.ModelError) as error:
        on_slider(0.2, **REFUSED[field])
    assert error.value.problems[0].field == field


def test_muscles_are_not_called_like_controls_and_stay_out_of_scenarios():
    model = reach().model
    with pytest.raises(pg.ModelError, match="rename"):
        model.replace(controls=(pg.State(name="flexor", rate=0.0),))
    scenario = pg.Scenario(name="pull", forces=model.forces)
    with pytest.raises(pg.ModelError, match="excitation"):
        model.replace(scenarios=(scenario,))


def test_a_slack_muscle_pulls_with_nothing():
    run = at_once(on_slider(0.1, model="thelen2003", excitation=0.0))
    assert run.success
    assert run.tension["m"][0] == pytest.approx(0.0, abs=1e-9)


def antagonists() -> pg.Mechanism:
    """A forearm with two flexors of different strength and an extensor."""
    mech = reach(model="thelen2003")
    (flexor,) = mech.model.forces
    strong = pg.Muscle(
        name="brachialis", body="fore", point=(0.03, 0, -0.05), other="arm",
        other_point=(0.03, 0, -0.1), f_max=900.0, l_opt=0.09, l_slack=0.15, model="millard2012",
    )  # fmt: skip
    back = pg.Muscle(
        name="triceps", body="fore", point=(-0.025, 0, 0.02), other="arm",
        other_point=(-0.02, 0, -0.05), f_max=700.0, l_opt=0.1, l_slack=0.15,
    )  # fmt: skip
    return pg.Mechanism(mech.model.replace(forces=(flexor, strong, back)))


@pytest.mark.parametrize("torque", [-9.0, -2.0, 3.0])
def test_activations_exert_the_torque_with_the_least_squares(torque):
    mech = antagonists()
    found = mech.activations({"fore": torque}, q={"fore": -0.7}, v={"fore": 0.4})
    assert not found.notices
    assert found.torque["fore"] == pytest.approx(torque, abs=1e-6)
    arms = mech.moment_arms(np.array([0.0, -0.7]))[:, 1]
    tensions = np.array([found.tension[name] for name in mech.path_names])
    assert arms @ tensions == pytest.approx(torque, abs=1e-6)
    # at the optimum, a is proportional to the torque per activation where no bound holds
    rigid = [f.unchecked_copy({"tendon": "rigid"}) for f in mech.model.forces]

    def pull(k: int, a: float) -> float:
        force = rigid[k].unchecked_copy({"excitation": a, "start": a})
        model = mech.model.replace(forces=(force,))
        run = pg.Mechanism(model).simulate(
            q={"fore": -0.7}, v={"fore": 0.4}, t_end=1e-6, method="dop853", frames=2
        )
        return float(run.tension[force.name][0])

    ratios = []
    for k, name in enumerate(mech.path_names):
        a = found.activation[name]
        assert pull(k, a) == pytest.approx(found.tension[name], rel=1e-6)
        if 0.02 < a < 0.98:
            slope = (pull(k, a + 0.01) - pull(k, a - 0.01)) / 0.02
            ratios.append(arms[k] * slope / a)
    assert len(ratios) >= 1
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-3)


def test_a_torque_out_of_reach_is_named():
    found = antagonists().activations({"fore": -400.0}, q={"fore": -0.7})
    assert len(found.notices) == 1
    assert "fore" in found.notices[0]
    assert found.activation["flexor"] == pytest.approx(1.0)
    assert -400.0 < found.torque["fore"] < -10.0
    with pytest.raises(pg.InputError, match="fore"):
        antagonists().activations({"for": 1.0})


MUSCLES_OF_MUJOCO = """<mujoco><compiler angle="radian"/><worldbody><site name="o"/>
<geom name="w" type="cylinder" size="0.03 0.1" pos="0 0 -0.3" euler="1.5708 0 0" contype="0"
 conaffinity="0"/><site name="s" pos="-0.1 0 -0.3"/>
<body name="fore" pos="0 0 -0.3"><joint name="j" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="1" contype="0" conaffinity="0"/>
<site name="e" pos="-0.02 0 -0.06"/><site name="g" pos="0.03 0 -0.06"/></body></worldbody>
<tendon><spatial name="back"><site site="o"/><geom geom="w" sidesite="s"/><site site="e"/></spatial>
<spatial name="front"><site site="o"/><site site="g"/></spatial></tendon>
<actuator>
<muscle name="triceps" tendon="back" lengthrange="0.3 0.42" force="300" timeconst="0.02 0.05"/>
<muscle name="biceps" tendon="front" lengthrange="0.25 0.36" tausmooth="0.3" vmax="2"/>
</actuator></mujoco>"""


@pytest.mark.parametrize("u", [(0.9, 0.1), (0.2, 0.7)])
def test_muscles_of_mjcf_act_as_in_mujoco(tmp_path, u):
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "arm.xml").write_text(MUSCLES_OF_MUJOCO)
    model, report = pg.read_mjcf(tmp_path / "arm.xml")
    assert report.loaded
    pg.write_mjcf(model, tmp_path / "again.xml")
    again, _ = pg.read_mjcf(tmp_path / "again.xml")
    own = mujoco.MjModel.from_xml_string(MUSCLES_OF_MUJOCO)
    data = mujoco.MjData(own)
    data.qpos[0], data.qvel[0], data.act[:], data.ctrl[:] = -0.7, 1.3, (0.3, 0.6), u
    mujoco.mj_forward(own, data)
    for one in (model, again):
        run = pg.Mechanism(one).simulate(
            t_end=1e-6, frames=2, method="dop853", q={"fore": -0.7}, v={"fore": 1.3},
            states={"triceps": 0.3, "biceps": 0.6}, inputs=dict(zip(("triceps", "biceps"), u)),
        )  # fmt: skip
        tensions = [run.tension[name][0] for name in ("triceps", "biceps")]
        np.testing.assert_allclose(tensions, -data.actuator_force, rtol=1e-12)
        np.testing.assert_allclose(run.vdot[0], data.qacc, rtol=1e-9)
        rates = (run.states[1] - run.states[0]) / 1e-6
        np.testing.assert_allclose(rates, data.act_dot, rtol=1e-3)


@pytest.mark.parametrize("model", ["degroote2016", "millard2012", "mujoco"])
@pytest.mark.parametrize("excitation", [0.0, 0.02])
def test_a_muscle_moves_about_its_equilibrium_as_its_linearisation(model, excitation):
    """That of Thelen has a corner at rest, where lengthening begins."""
    mech = pg.Mechanism(held(model=model, excitation=excitation))
    rest = mech.equilibrium()
    here = mech.linearise(rest.q)
    assert np.abs(here.drift).max() < 1e-6
    moved = rest.q + 1e-4
    one = mech.simulate(t_end=0.3, q=rest.q, method="radau5", rtol=1e-10, frames=4)
    two = mech.simulate(t_end=0.3, q=moved, method="radau5", rtol=1e-10, frames=4)
    apart = np.hstack((two.q - one.q, two.v - one.v, two.states - one.states))
    for t, found in zip(two.t, apart):
        wanted = expm(here.A * t) @ apart[0]
        assert found == pytest.approx(wanted, abs=3e-3 * np.abs(apart[:, :2]).max())


@pytest.mark.parametrize("model", ELASTIC)
@pytest.mark.parametrize("excitation", [0.0, 0.3, 1.0])
def test_a_muscle_that_is_held_is_known_to_stay(model, excitation):
    """Its states, which do not change, are judged by their usual size."""
    mech = on_slider(0.24, model=model, excitation=excitation)
    fixed = pg.Motion(name="hold", body="block", q_of_t="=0.24")
    run = pg.simulate(mech.model.add(fixed), t_end=1.0)
    assert not run.notices
    assert np.ptp(run["fibre.m"]) < 1e-5 * 0.1


def test_fixed_steps_are_judged_by_the_excitation_of_the_call():
    """At a low activation the fibre is ten times as fast as the steps allow."""
    model = held(excitation=0.0)
    assert any("stiff" in text for text in pg.simulate(model, t_end=0.1, method="rk4").notices)
    run = pg.simulate(model, t_end=0.1, method="rk4", inputs={"flexor": 0.75})
    assert not run.notices


def test_an_arm_at_rest_tells_of_no_error():
    """What it moves is less than the tolerance, and most of that is error."""
    model = held(excitation=0.02, tendon="rigid")
    rest = pg.Mechanism(model).equilibrium().q
    run = pg.simulate(model, q=rest, t_end=5.0)
    assert np.ptp(run.q) < 1e-7
    assert not run.notices


def test_the_excitation_of_the_model_is_an_input_to_differentiate_by():
    model, tight = held(excitation=0.08), {"t_end": 0.3, "method": "dop853", "rtol": 1e-11}
    found = pg.simulate(model, wrt=["inputs.flexor"], **tight).sensitivity("inputs.flexor")[-1]
    one, two = (pg.simulate(model, inputs={"flexor": 0.08 + h}, **tight) for h in (1e-4, -1e-4))
    wanted = [(a[-1, 0] - b[-1, 0]) / 2e-4 for a, b in ((one.q, two.q), (one.v, two.v))]
    assert found == pytest.approx(wanted, rel=1e-5)


def test_errors_and_times_are_measured_for_a_model_with_states():
    study = pg.work_precision(held(excitation=0.3), t_end=0.02, methods=["rk4"], steps=[2e-3, 1e-3],
                              rounds=1)  # fmt: skip
    assert [row.error < 1e-4 for row in study.rows] == [True, True]


def test_activations_have_no_scale_of_their_own_and_heed_joints_without_a_muscle():
    """A joint on which no muscle acts asks for the torque 0."""
    mech, at = antagonists(), {"q": {"fore": -0.7}}
    whole = mech.activations({"fore": -8.0}, **at)
    also = mech.activations({"fore": -8.0, "arm": 0.0}, **at)
    assert also.activation == pytest.approx(whole.activation, abs=1e-6)
    assert not also.notices
    small = mech.model.replace(
        forces=tuple(f.unchecked_copy({"f_max": 1e-6 * f.f_max}) for f in mech.model.forces)
    )
    found = pg.Mechanism(small).activations({"fore": -8e-6}, **at)
    assert found.activation == pytest.approx(whole.activation, abs=1e-6)
    assert found.torque["fore"] == pytest.approx(-8e-6, rel=1e-6)


# excitation, activation, and the rate of the activation in OpenSim 4.6 [1/s]
RATES = ((0.9, 0.5, 15.09), (0.9, 0.02, 63.7), (0.01, 0.5, -17.8))


@pytest.mark.parametrize(("u", "a", "rate"), RATES)
def test_activation_changes_as_in_the_model_of_de_groote(u, a, rate):
    run = pg.simulate(held(excitation=u, start=a), t_end=1e-6, frames=2, method="dop853")
    assert np.diff(run.states[:, 0]) / 1e-6 == pytest.approx(rate, rel=2e-3)


def test_a_fibre_without_damping_is_refused_where_no_speed_balances_it():
    problem = refusal(lambda: held(model="millard2012", damping=0.0))
    assert_names(str(problem), "'flexor'", "damping", "> 0", "'rigid'")
    held(model="degroote2016", damping=0.0)


def test_no_equilibrium_is_found_beside_a_state_where_a_force_is_left():
    """Its force is the same everywhere, so that no step changes it."""
    body = pg.Body(name="b", joint="prismatic", axes=[(1, 0, 0)], mass=1, q=(0.2,))
    model = pg.Model(
        gravity=(0, 0, 0), bodies=[body], forces=[pg.Motor(name="m", body="b", torque=5)]
    )
    controlled = model.add(pg.Filter(name="f", input="=sin(t)", lag=0.1))
    for one in (model, controlled):
        assert_names(str(refusal(lambda one=one: pg.Mechanism(one).equilibrium())), "5 (N", "'b'")

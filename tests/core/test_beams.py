"""Beams follow the closed forms of elastic rods, and their error in space is known."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

import pgraph_core as pg
from pgraph_core.model.beam import circle, rectangle, tube
from pgraph_core.model.segments import divided
from pgraph_core.show.shapes import pieces

ELASTICA = {1: (0.301721, 0.056433), 5: (0.713792, 0.387628), 10: (0.810609, 0.554996)}


def planar(n=20, **fields):
    """A beam of unit length, stiffness and mass, which bends about y."""
    given = {"length": 1.0, "EI": 1.0, "rho_a": 1.0, "strains": ("bend_y",), "nodes": n}
    return pg.Beam(name="rod", **{**given, **fields})


def held(beam, *forces, **fields):
    return pg.Model(beams=[beam], forces=forces, **{"gravity": (0, 0, 0), **fields})


def tip(model):
    mech = pg.Mechanism(model)
    return mech.pose(mech.equilibrium(), "rod")


# -- sections --------------------------------------------------------------------------------------


def test_sections_have_the_properties_of_closed_forms():
    r, inner = 0.02, 0.015
    assert circle(r).bending[0] == pytest.approx(math.pi * r**4 / 4, rel=1e-14)
    assert circle(r).torsion == pytest.approx(math.pi * r**4 / 2, rel=1e-14)
    assert tube(r, inner).area == pytest.approx(math.pi * (r**2 - inner**2), rel=1e-14)
    assert tube(r, inner).torsion == pytest.approx(math.pi * (r**4 - inner**4) / 2, rel=1e-14)
    second = (
        quad(lambda z: 0.03 * z * z, -0.005, 0.005)[0],
        quad(lambda y: 0.01 * y * y, -0.015, 0.015)[0],
    )
    assert rectangle(0.03, 0.01).bending == pytest.approx(second, rel=1e-12)


@pytest.mark.parametrize(("ratio", "share"), [(1, 0.1406), (2, 0.229), (10, 0.312)])
def test_the_torsion_of_a_rectangle_is_that_of_the_tables(ratio, share):
    """Timoshenko and Goodier, Theory of Elasticity, section 109: J = share * a b^3."""
    assert rectangle(ratio, 1.0).torsion == pytest.approx(share * ratio, rel=3e-3)
    assert rectangle(1.0, ratio).torsion == rectangle(ratio, 1.0).torsion


def test_materials_and_sections_give_the_stiffness():
    rod = pg.Beam(name="rod", length=2.0, section=("rectangle", 0.04, 0.01), material="steel")
    stiff = rod.stiff
    assert pytest.approx(210e9 * 4e-4) == stiff.EA
    assert pytest.approx((210e9 * 0.04 * 0.01**3 / 12, 210e9 * 0.01 * 0.04**3 / 12)) == stiff.EI
    assert stiff.rho_a == pytest.approx(7850 * 4e-4)
    total = sum(b.mass for b in pg.Mechanism(pg.Model(beams=[rod])).model.bodies)
    assert total == pytest.approx(7850 * 4e-4 * 2.0, rel=1e-13)


# -- statics ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("load", ELASTICA)
def test_a_cantilever_follows_the_elastica_with_order_two(load):
    """The exact values are elliptic integrals. Richardson's rule leaves 1e-5 of the length."""
    force = pg.Wrench(name="P", body="rod", force=(0, 0, -load))
    ends = np.array([tip(held(planar(n), force)).position for n in (10, 20, 40)])
    found = np.stack((-ends[:, 2], 1 - ends[:, 0]), axis=1)
    errors = np.abs(found - ELASTICA[load])
    assert errors[:, 0].max() < 4e-3
    assert errors[:-1, 0] / errors[1:, 0] == pytest.approx(4.0, rel=0.05)
    assert np.abs(found[2] + (found[2] - found[1]) / 3 - ELASTICA[load]).max() < 1e-5


def test_loads_at_the_tip_meet_the_whole_compliance():
    """Half of a cell is at each end, so that stretch and twist by end loads have no error."""
    every = {
        "strains": ("stretch", "twist", "bend_y", "bend_z"),
        "GJ": 5.0,
        "EA": 7.0,
        "rho_j": 1.0,
    }
    wrench = pg.Wrench(name="w", body="rod", force=(0.07, 0, 0), torque=(0.5, 0, 0))
    end = tip(held(planar(3, length=2.0, **every), wrench))
    assert end.position[0] == pytest.approx(2.0 * (1 + 0.07 / 7.0), abs=1e-12)
    assert math.atan2(end.rotation[2, 1], end.rotation[1, 1]) == pytest.approx(0.2, abs=1e-12)


def test_an_end_moment_rolls_a_beam_up_to_a_circle():
    n = 5
    moment = pg.Wrench(name="M", body="rod", torque=(0, -2 * math.pi, 0))
    mech = pg.Mechanism(held(planar(n), moment))
    end = mech.pose(mech.equilibrium(np.full(n, -1.96 * math.pi / n)), "rod")
    assert np.abs(end.position).max() < 1e-10
    assert np.abs(end.rotation - np.eye(3)).max() < 1e-10


def test_a_corner_is_as_two_beams():
    kind = {"section": ("rectangle", 0.02, 0.01), "material": "aluminium"}
    one = pg.Beam(name="rod", points=((0.4, 0, 0), (0.4, 0, 0.3)), nodes=14, **kind)
    first = pg.Beam(name="first", length=0.4, nodes=8, **kind)
    second = pg.Beam(name="rod", parent="first", points=((0, 0, 0.3),), nodes=6, **kind)
    found = [tip(pg.Model(beams=beams)) for beams in ([one], [first, second])]
    assert found[0].position == pytest.approx(found[1].position, abs=1e-12)


def test_places_and_corners_are_ends_of_cells():
    assert divided(np.array([0.5, 0.5]), 20) == [10, 10]
    assert divided(np.array([0.1, 0.9]), 20) == [2, 18]
    assert divided(np.array([1e-3, 1.0]), 7) == [1, 6]
    assert divided(np.ones(5), 3) == [1] * 5
    model = held(planar(10), pg.Wrench(name="w", body="rod@0.3", force=(0, 0, 1)))
    assert pg.Mechanism(model).model.segments == {"rod": [4, 6]}


# -- dynamics --------------------------------------------------------------------------------------


def test_the_frequencies_of_a_cantilever_are_those_of_euler_and_bernoulli():
    found = []
    for n in (20, 40):
        rates = np.abs(pg.Mechanism(held(planar(n))).linearise().eigenvalues.imag)
        found.append(np.sort(rates)[::2][:3])
    exact = np.array([3.5160153, 22.0344916, 61.6972144])
    assert found[1] / exact == pytest.approx(1.0, abs=1e-3)
    assert (found[1] + (found[1] - found[0]) / 3) / exact == pytest.approx(1.0, abs=1e-5)
    assert planar().lowest_frequency == pytest.approx(exact[0], rel=1e-7)


def spin_up(n):
    """Kane's manoeuvre: a hub turns up to 6 rad/s within 15 s (J Guid 10 (1987) 139-151)."""
    turn = "=if(t < 15, 6/15*(t^2/2 + (15/(2*pi))^2*(cos(2*pi*t/15) - 1)), 45 + 6*(t - 15))"
    hub = pg.Body(name="hub", axes=(0, 0, 1), mass=0.0, inertia=(1, 1, 1))
    rod = planar(n, parent="hub", length=10.0, EI=1.4e4, rho_a=1.2, strains=("bend_z",))
    motion = pg.Motion(name="turn", body="hub", q_of_t=turn)
    return held(rod, bodies=[hub], constraints=[motion])


def test_a_beam_that_is_spun_up_lags_as_in_the_literature_and_knows_its_error():
    run = pg.simulate(spin_up(16), t_end=18.0, method="radau5", rtol=1e-6, frames=601)
    at, turned = run.position["rod"], run["hub"]
    lag = np.sin(turned) * at[:, 0] - np.cos(turned) * at[:, 1]
    true = 0.57375 - lag.max()
    assert lag.max() == pytest.approx(0.5737, abs=2.5e-3)
    assert 0.2 < run.space_error / true < 10
    assert run.error_estimate < 1e-4 < run.space_error
    assert np.abs(lag[run.t > 15]).max() < 1e-2  # a linear model without stiffening diverges


def test_the_moment_of_a_joint_is_the_load_times_its_arm():
    force = pg.Wrench(name="P", body="rod", force=(0, 0, -1e-3))
    rod = planar(10, rho_a=1e-3, damping_ratio=0.5)
    run = pg.simulate(held(rod, force), t_end=5.0, estimate=False)
    assert run["moment.rod[3]"][-1] == pytest.approx(1e-3 * 0.75, rel=1e-5)
    assert run["rod.tip"][-1] == pytest.approx(run.position["rod"][-1])
    assert np.isnan(run.space_error)


def test_segments_double_until_the_tolerance_is_met():
    rod = planar("auto", tolerance=1e-3, damping_ratio=0.05)
    force = pg.Wrench(name="P", body="rod", force=(0, 0, -1))
    run = pg.simulate(held(rod, force), t_end=1.0, rtol=1e-6, frames=51)
    assert run.space_error <= 1e-3
    assert any("nodes='auto'" in text for text in run.notices)
    fine = planar(64, damping_ratio=0.05)
    true = pg.simulate(held(fine, force), t_end=1.0, rtol=1e-6, frames=51, estimate=False)
    off = np.linalg.norm(run.position["rod"] - true.position["rod"], axis=1).max()
    assert off <= 1.5e-3


def test_a_tolerance_out_of_reach_is_told():
    rod = planar("auto", tolerance=1e-9, damping_ratio=0.05)
    force = pg.Wrench(name="P", body="rod", force=(0, 0, -1))
    run = pg.simulate(held(rod, force), t_end=0.5, rtol=1e-6, frames=11)
    told = next(text for text in run.notices if "nodes='auto'" in text)
    assert "500 are too few" in told
    assert "16 segments" in told


def test_a_beam_in_a_loop():
    crank = pg.Body(name="crank", axes=(0, 1, 0), inertia=(1e-3,) * 3, tip=(0.1, 0, 0))
    pin = pg.Body(name="pin", parent="crank", axes=(0, 1, 0), link=(0.1, 0, 0), mass=0.0)
    slider = pg.Body(name="slider", joint="prismatic", axes=(1, 0, 0), link=(0.5, 0, 0), mass=0.5)
    rod = planar(8, parent="pin", length=0.4, EI=20.0, rho_a=0.6)
    ends = {"point": (0, 0, 0), "other_point": (0, 0, 0)}
    joint = pg.Point(name="joint", body="rod", other="slider", **ends)
    drive = pg.Motion(name="drive", body="crank", q_of_t="=20*t^2/2")
    model = held(rod, bodies=[crank, pin, slider], constraints=[joint, drive])
    run = pg.simulate(model, t_end=0.5, rtol=1e-6, frames=51)
    assert run.success
    assert run.constraint_drift[:, 0].max() < 1e-9
    assert 0 < run.space_error < 1e-3


# -- derivatives -----------------------------------------------------------------------------------


def test_runs_have_derivatives_by_the_numbers_of_a_beam():
    rod = pg.Beam(
        name="rod", length=1.0, section=("circle", 0.003), E=2e9, G=1e9, density=1000,
        strains=("bend_y",), nodes=4, damping_ratio=0.05,
    )  # fmt: skip
    model = pg.Model(beams=[rod])
    call = {"t_end": 0.3, "estimate": False, "rtol": 1e-10, "method": "radau5", "frames": 11}
    paths = {"beams.rod.length": 1.0, "beams.rod.E": 2e9, "beams.rod.section.1": 0.003}
    run = pg.simulate(model, wrt=[*paths], **call)
    for path, x in paths.items():
        up, down = (pg.simulate(model.edit(path, x * (1 + h)), **call).q[-1] for h in (1e-4, -1e-4))
        slope = (up - down) / (2e-4 * x)
        near = 1e-4 * max(abs(slope))
        assert run.sensitivity(path)[-1, :4] == pytest.approx(slope, abs=near)


# -- edits and files -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def carrying():
    rod = pg.Beam(name="left rod", parent="hub", length=1.0, EI=2.0, GJ=1.0, rho_a=1.0, rho_j=1.0)
    load = pg.Body(name="load", parent="left rod@0.5", joint="weld")
    hub = pg.Body(name="hub", axes=(0, 0, 1))
    site = pg.Site(name="end", body="left rod")
    return pg.Model(bodies=[hub, load], beams=[rod], sites=[site])


def test_places_follow_a_new_name(carrying):
    new = carrying.edit("left rod", name="pole")
    assert new.body("load").parent == "pole@0.5"
    assert new.sites[0].body == "pole"
    assert carrying.edit("hub", name="base").beams[0].parent == "base"


def test_files_keep_beams(carrying):
    assert pg.Model.from_json(carrying.to_json()) == carrying
    assert '"schema_version": 10' in carrying.to_json()
    assert carrying.beams[0].at(0.5) == "left rod@0.5"


def test_a_mirror_image_has_mirrored_places(carrying):
    both = carrying.mirror("left rod", plane="x")
    mech = pg.Mechanism(both)
    ends = [mech.pose(mech.home()[0], name).position for name in ("left rod", "right rod")]
    assert ends[0] == pytest.approx(-ends[1])
    assert both.body("load_2").parent == "right rod@0.5"
    twice = carrying.duplicate("hub")
    assert [b.parent for b in twice.beams] == ["hub", "hub_2"]


def test_what_a_removed_beam_carried_hangs_on_its_parent(carrying):
    left = carrying.remove("left rod")
    assert not left.beams
    assert (left.body("load").parent, left.body("load").link) == ("hub", (0.5, 0.0, 0.0))
    assert [b.name for b in carrying.remove("left rod", children="delete").bodies] == ["hub"]


def test_runs_have_the_model_with_beams(carrying, tmp_path):
    run = pg.simulate(carrying, t_end=0.01, frames=3)
    assert run.model is carrying
    run.save(tmp_path / "run.npz")
    again = pg.Result.load(tmp_path / "run.npz")
    assert again.model == carrying
    assert again == run


def test_other_formats_receive_the_segments(carrying, tmp_path):
    report = pg.write_mjcf(carrying, tmp_path / "rod.xml")
    assert any("20 segments" in str(entry) for entry in report.of("converted"))
    read = pg.load(tmp_path / "rod.xml")
    assert pg.Mechanism(read).nv == pg.Mechanism(carrying).nv


def test_a_given_start_serves_for_other_segments():
    """Joints of half the cell take half of the angle, so that both runs begin with one shape."""
    model = held(planar(8, damping_ratio=0.05))
    bent = np.full(8, 0.1)
    run = pg.simulate(model, q=bent, t_end=0.2, rtol=1e-6, frames=11)
    assert 0 < run.space_error < 0.02
    assert run.space_error_at[0] < 1e-3


def test_a_large_error_in_space_is_told():
    force = pg.Wrench(name="P", body="rod", force=(0, 0, -5))
    run = pg.simulate(held(planar(2, damping_ratio=0.05), force), t_end=1.0, rtol=1e-6, frames=51)
    assert run.space_error > 0.01
    assert any("rough" in text and "nodes=4" in text for text in run.notices)


def test_an_optimal_stiffness_is_found_from_a_noisy_tip():
    rod = planar(4, EI=2.0, rho_a=0.1, damping_ratio=0.05)
    model = pg.Model(beams=[rod], outputs=[pg.Output(name="tip", kind="position", at="rod")])
    truth = pg.simulate(model, t_end=1.0, frames=51, rtol=1e-8, estimate=False)
    noise = np.random.default_rng(0).normal(size=51)
    data = {"t": truth.t, "tip.z": truth.columns()["tip.z"] + 1e-4 * noise}
    found = pg.fit(model.edit("rod", EI=1.5), data, {"beams.rod.EI": (0.5, 5.0)})
    assert found.values["beams.rod.EI"] == pytest.approx(2.0, abs=2e-3)


def test_an_edit_of_the_segments_leaves_the_beam():
    segments = pg.Mechanism(held(planar(4))).model
    assert segments.described.beams
    lighter = segments.edit("rod[2]", mass=0.1)
    assert lighter.described is lighter
    assert pg.Mechanism(lighter).nv == 4


def test_a_place_is_not_drawn():
    model = pg.Mechanism(held(planar(4))).model
    assert pieces(model.body("rod"), ()) == ()
    assert len(pieces(model.body("rod[2]"), ())) > 1


def test_a_run_that_fails_has_no_error_in_space():
    run = pg.simulate(held(planar(8), gravity=(0, 0, -9.81)), t_end=1.0, method="rk4", step=0.02)
    assert not run.success
    assert np.isnan(run.space_error)
    assert any("radau5" in text for text in run.notices)


@pytest.mark.parametrize(("GJ", "doubted"), [(1.0, 0), (1e-5, 1), (None, 0)])
def test_a_beam_that_next_to_nothing_holds_against_twist_is_named_with_the_remedy(GJ, doubted):
    rod = pg.Beam(name="rod", length=1.0, EI=100.0, GJ=GJ, rho_a=1.0, rho_j=1e-4, nodes=4)
    found = [text for text in pg.Model(beams=[rod]).doubts if "GJ" in text]
    assert len(found) == doubted
    assert all("rod" in text and "1e-05" in text and "strains" in text for text in found)


def test_the_error_in_space_is_known_in_the_frame_where_an_event_stops_both_runs():
    hub = pg.Body(name="hub", joint="revolute", axes=[[0, 1, 0]], mass=0.1, inertia=[1e-3] * 3)
    rod = planar(8, parent="hub", damping_ratio=0.1)
    model = pg.Model(bodies=[hub], beams=[rod])

    def low(t, q, v):
        return q[0] - 0.3

    low.terminal = True
    run = pg.simulate(model, t_end=2.0, events=low, frames=41)
    assert run.status.name == "STOPPED"
    assert np.isfinite(run.space_error_at).all()
    assert 0 < run.space_error < 0.1 * rod.extent

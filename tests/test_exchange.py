"""Facts in files of other formats: sizes, colours, states and omissions."""

import numpy as np
import pytest

import pgraph_core as pg


@pytest.fixture
def mujoco():
    return pytest.importorskip("mujoco")


def from_mjcf(folder, text: str) -> tuple[pg.Model, pg.Report]:
    path = folder / "m.xml"
    path.write_text(f"<mujoco>{text}</mujoco>")
    return pg.read_mjcf(path)


def test_a_heightfield_has_the_size_of_the_file(mujoco, tmp_path):
    model, _ = from_mjcf(
        tmp_path,
        """<asset><hfield name="h" nrow="2" ncol="3" size="1 3 0.5 0.2" elevation="0 1 0 1 0 0"/>
        </asset><worldbody><body name="b"><freejoint/><geom type="sphere" size="1"/></body>
        <body name="hill"><geom type="hfield" hfield="h"/></body></worldbody>""",
    )
    (shape,) = next(b for b in model.bodies if b.name == "hill").shapes
    assert shape.size == pytest.approx((2.0, 6.0, 0.2))
    assert np.shape(shape.heights) == (3, 2)
    assert np.ptp(shape.heights) == pytest.approx(0.5)


def test_the_first_material_colours_its_geoms(mujoco, tmp_path):
    model, _ = from_mjcf(
        tmp_path,
        """<asset><material name="red" rgba="1 0 0 1"/><material name="blue" rgba="0 0 1 1"/>
        </asset><worldbody><body name="b"><freejoint/><geom size="1" material="red"/>
        <geom size="1" material="blue"/><geom size="1"/></body></worldbody>""",
    )
    colours = [shape.colour for shape in model.bodies[0].shapes]
    assert colours == [(1, 0, 0), (0, 0, 1), None]


def test_bodies_in_between_hinges_are_reported(mujoco, tmp_path):
    _, report = from_mjcf(
        tmp_path,
        """<worldbody><body name="arm"><joint axis="0 0 1"/><joint axis="0 1 0" pos="0 0 1"/>
        <geom size="1"/></body></worldbody>""",
    )
    assert "arm" in [entry.part for entry in report.of("converted")]


def test_sites_with_the_name_that_another_would_get_stay_apart(mujoco, tmp_path):
    """The site 'a' cannot have its body's name, and 'a site' is taken by another site."""
    model, _ = from_mjcf(
        tmp_path,
        """<worldbody><body name="a"><freejoint/><geom size="1"/><site name="a site" pos="1 0 0"/>
        <site name="a" pos="2 0 0"/></body></worldbody>
        <sensor><framepos objtype="site" objname="a"/><framepos objtype="site" objname="a site"/>
        </sensor>""",
    )
    places = sorted(site.point[0] for site in model.sites)
    assert places == [1.0, 2.0]
    assert len({site.name for site in model.sites}) == 2


def test_a_ball_joint_on_a_turned_body_has_its_pose_in_a_key(mujoco, tmp_path):
    turn, home = (0.8, 0.6, 0.0, 0.0), (0.5, 0.5, -0.5, 0.5)
    body = pg.Body(
        name="b", joint="spherical", rotation=home, q=turn, mass=1.0, inertia=np.diag((1.0, 2, 2.5))
    )
    model = pg.Model(bodies=[body], scenarios=[pg.Scenario(name="s")])
    pg.write_mjcf(model, tmp_path / "m.xml")
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, data, 0)
    mujoco.mj_forward(m, data)
    mech = pg.Mechanism(model)
    _, expected = mech.pose(mech.home()[0], "b")
    np.testing.assert_allclose(data.body("b").xmat.reshape(3, 3), expected, atol=1e-12)


def test_drags_are_a_fluid_only_if_every_body_has_its_own_box(mujoco, tmp_path):
    """An inertia box has edges from the moments. A drag on another box is omitted."""
    bodies = [
        pg.Body(name=n, joint="free", mass=6.0, inertia=np.diag((5.0, 4.0, 3.0))) for n in "ab"
    ]
    own = np.sqrt(np.array((5.0 + 4 + 3) - 2 * np.array((5.0, 4.0, 3.0))))
    for sizes, fluid in (((own, own), True), ((own, 2 * own), False), ((2 * own, own), False)):
        drags = [
            pg.Force(name=f"d{n}", kind="drag", body=n, size=size, density=1000.0)
            for n, size in zip("ab", sizes)
        ]
        report = pg.write_mjcf(pg.Model(bodies=bodies, forces=drags), tmp_path / "m.xml")
        m = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
        assert (m.opt.density == 1000.0) == fluid
        lost = [name for e in report.of("left out") for name in ("'da'", "'db'") if name in e.where]
        assert lost == ([] if fluid else ["'da'", "'db'"])


def test_an_inertia_without_mass_is_written_to_urdf(tmp_path):
    bodies = [
        pg.Body(name="a", mass=1.0, inertia=np.eye(3)),
        pg.Body(name="rotor", parent="a", mass=0.0, inertia=np.diag((0.1, 0.2, 0.3))),
    ]
    pg.write_urdf(pg.Model(bodies=bodies), tmp_path / "m.urdf")
    again = pg.load(tmp_path / "m.urdf")
    (rotor,) = [b for b in again.bodies if b.name == "rotor"]
    np.testing.assert_allclose(rotor.inertia, np.diag((0.1, 0.2, 0.3)))


def test_a_shape_that_urdf_lacks_is_left_out_by_name(tmp_path):
    shape = {"kind": "ellipsoid", "radii": (1, 2, 3)}
    body = pg.Body(name="egg", mass=1.0, inertia=np.eye(3), shape=shape)
    report = pg.write_urdf(pg.Model(bodies=[body]), tmp_path / "m.urdf")
    assert "egg" in [entry.part for entry in report.of("left out")]
    assert not pg.load(tmp_path / "m.urdf").bodies[0].shapes


@pytest.mark.parametrize(("turn", "reported"), [(0.4, False), (0.5, True)])
def test_a_weld_of_turned_sites_is_reported_only_if_they_do_not_agree(
    mujoco, tmp_path, turn, reported
):
    """The second body is turned by 0.8 rad about y, and its site back by twice `turn`."""
    half, back = (np.cos(0.4), np.sin(0.4)), (np.cos(turn), -np.sin(turn))
    _, report = from_mjcf(
        tmp_path,
        f"""<worldbody><body name="a"><freejoint/><geom size="1"/><site name="s"/></body>
        <body name="b" quat="{half[0]} 0 {half[1]} 0"><freejoint/><geom size="1"/>
        <site name="t" quat="{back[0]} 0 {back[1]} 0"/></body></worldbody>
        <equality><weld name="tie" site1="s" site2="t"/></equality>""",
    )
    assert report.loaded != reported
    assert any("tie" in entry.where for entry in report.of("left out")) == reported


@pytest.mark.parametrize(
    ("q", "v"), [((0.0,), (0.0,)), ((0.3,), (0.0,)), ((0.0,), (-2.0,)), ((0.3,), (1.0,))]
)
def test_a_start_is_written_to_mjcf_and_named_where_urdf_has_none(q, v, tmp_path):
    arm = pg.Body("arm", axes=(0, 1, 0), com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.1), q=q, v=v)
    model = pg.Model([arm], scenarios=[pg.Scenario(name="pushed", v={"arm": (3.0,)})])
    pytest.importorskip("mujoco")
    pg.write_mjcf(model, tmp_path / "arm.xml")
    found = pg.load(tmp_path / "arm.xml")
    assert (found.bodies[0].q, found.bodies[0].v) == (q, v)
    text = str(pg.write_urdf(model, tmp_path / "arm.urdf"))
    assert ("initial state of arm" in text) == (any(q) or any(v))
    assert "1 scenario: pushed" in text

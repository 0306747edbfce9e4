"""Reading models of OpenSim: joints, functions, forces, and what is refused or named as lost."""

import itertools

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.cli import main
from pgraph_core.formats.osim_functions import simm_rows
from pgraph_core.formats.osim_text import turned
from pgraph_core.rotation import matrix
from tests.refusals import assert_names

pytestmark = pytest.mark.quick
PIN = """<PinJoint name="hip"><socket_parent_frame>/ground</socket_parent_frame>
<socket_child_frame>/bodyset/leg</socket_child_frame><coordinates><Coordinate name="flexion">
<default_value>0.2</default_value><range>-1 1.5</range>{}</Coordinate></coordinates></PinJoint>"""
BODY = (
    "<Body name='{}'><mass>2</mass><mass_center>0 -1 0</mass_center><inertia>1 1 1 0 0 0</inertia>"
)
LEG = BODY.format("leg") + "</Body>"
HIP = PIN.format("")
LINE = "<LinearFunction><coefficients>1 0</coefficients></LinearFunction>"
BEND = "<SimmSpline><x>-1 0 1 2</x><y>0.1 0 0.3 0.2</y></SimmSpline>"


def document(bodies=LEG, joints=HIP, version=40000, **sets):
    """Return the text of a model with these sets of parts."""
    sets = {"BodySet": bodies, "JointSet": joints, **sets}
    inside = "\n".join(f"<{x}><objects>{y}</objects></{x}>" for x, y in sets.items())
    return (
        f'<OpenSimDocument Version="{version}"><Model name="m">{inside}</Model></OpenSimDocument>'
    )


def custom(coordinates, **axes):
    """Return a CustomJoint with (coordinates, direction, function) of some axes."""
    own = "".join(f'<Coordinate name="{x}"/>' for x in coordinates.split())
    rows = "".join(
        f'<TransformAxis name="{name}"><coordinates>{c}</coordinates><axis>{axis}</axis>'
        f"{function}</TransformAxis>"
        for name, (c, axis, function) in axes.items()
    )
    return f"""<CustomJoint name="hip"><socket_parent_frame>/ground</socket_parent_frame>
    <socket_child_frame>/bodyset/leg</socket_child_frame><coordinates>{own}</coordinates>
    <SpatialTransform>{rows}</SpatialTransform></CustomJoint>"""


@pytest.fixture
def read(tmp_path):
    def reading(text=None, name="m.osim", **parts):
        path = tmp_path / name
        path.write_text(document(**parts) if text is None else text)
        return pg.read_osim(path)

    return reading


# -- what is read ----------------------------------------------------------------------------------


def test_a_file_is_loaded_by_name_and_by_content(tmp_path):
    for name in ("m.osim", "m.xml"):
        (tmp_path / name).write_text(document())
        model = pg.load(tmp_path / name)
        assert model.body("leg").q == (0.2,)
        assert model.up == "y"
        assert [out.name for out in model.outputs] == ["flexion"]


def test_convert_writes_the_model_and_it_reads_back_equal(tmp_path):
    joint = custom("knee", rotation1=("knee", "0 0 1", LINE), translation1=("knee", "1 0 0", BEND))
    (tmp_path / "m.osim").write_text(document(joints=joint))
    assert main(["convert", str(tmp_path / "m.osim"), str(tmp_path / "m.json")]) == 0
    assert pg.load(tmp_path / "m.json") == pg.load(tmp_path / "m.osim")
    with pytest.raises(pg.FileError, match=r"\.json"):
        pg.load(tmp_path / "m.osim").save(tmp_path / "again.osim")


def test_clamped_coordinates_have_limits_and_locked_ones_a_motion(read):
    free, _ = read()
    clamped, _ = read(joints=PIN.format("<clamped>true</clamped>"))
    locked, _ = read(joints=PIN.format("<clamped>true</clamped><locked>true</locked>"))
    assert free.body("leg").limits == ()
    assert clamped.body("leg").limits == ((-1.0, 1.5),)
    assert not locked.body("leg").limits
    (held,) = locked.constraints
    assert (held.kind, held.q_of_t.coefficients) == ("motion", (0.2,))


def test_a_frame_of_a_body_names_its_body_by_dots(read):
    frame = """<components><PhysicalOffsetFrame name="knee"><socket_parent>..</socket_parent>
    <translation>0 -1 0</translation></PhysicalOffsetFrame></components></Body>"""
    mark = """<Marker name="mark"><socket_parent_frame>/bodyset/leg/knee</socket_parent_frame>
    <location>0.1 0 0</location></Marker>"""
    model, _ = read(bodies=LEG.replace("</Body>", frame), MarkerSet=mark)
    assert (model.sites[0].body, model.sites[0].point) == ("leg", (0.1, -1, 0))


def test_a_body_without_a_joint_is_free_as_in_opensim(read):
    model, report = read(joints="")
    assert model.body("leg").joint == "free"
    assert_names(str(report), "leg", "free")


def test_a_simm_spline_ends_with_the_third_derivatives_of_cubics_through_four_points():
    """So that points of a cubic give the cubic, and those of a parabola or line these."""
    x = [-1.0, -0.3, 0.1, 0.7, 1.6]
    p = np.polynomial.Polynomial([0.3, -0.2, 0.5, 0.7])
    for n, degree in ((2, 1), (3, 2), (4, 3), (5, 3)):
        f = p.cutdeg(degree)
        slopes = [row[2] for row in simm_rows(x[:n], [f(a) for a in x[:n]])]
        np.testing.assert_allclose(slopes, f.deriv()(np.array(x[:n])), atol=1e-14)


def test_a_curve_of_a_joint_is_a_straight_line_beyond_its_spline(read):
    axes = {"rotation1": ("knee", "1 0 0", LINE), "translation1": ("knee", "1 0 0", BEND)}
    joint = custom("knee", **axes)
    mech = pg.Mechanism(read(joints=joint)[0])
    rows = simm_rows([-1.0, 0.0, 1.0, 2.0], [0.1, 0.0, 0.3, 0.2])
    for q, (x, y, slope) in ((2.9, rows[-1]), (-1.7, rows[0])):
        expected = y + slope * (q - x)
        np.testing.assert_allclose(mech.pose([q], "leg")[0], [expected, 0, 0], atol=1e-14)


def test_a_coordinate_that_follows_another_body_starts_where_its_leader_puts_it(read):
    second = PIN.replace("hip", "knee").replace("/ground", "/bodyset/leg").format("")
    second = second.replace("child_frame>/bodyset/leg", "child_frame>/bodyset/shank")
    joints = HIP + second.replace("flexion", "bend")
    coupler = f"""<CoordinateCouplerConstraint name="c"><coupled_coordinates_function>{BEND}
    </coupled_coordinates_function><independent_coordinate_names>flexion
    </independent_coordinate_names><dependent_coordinate_name>bend</dependent_coordinate_name>
    <scale_factor>2</scale_factor></CoordinateCouplerConstraint>"""
    bodies = LEG + BODY.format("shank") + "</Body>"
    model, _ = read(bodies=bodies, joints=joints, ConstraintSet=coupler)
    curve = model.constraints[0].curve
    assert (curve.kind, curve.value) == ("hermite", (0.2, 0.0, 0.6, 0.4))
    assert model.body("shank").q == pytest.approx(curve.values(np.array([0.2])))


# -- forces ----------------------------------------------------------------------------------------


def test_a_limit_force_grows_by_a_quintic_step_and_damps(read):
    force = """<CoordinateLimitForce name="stop"><coordinate>flexion</coordinate>
    <upper_stiffness>20</upper_stiffness><upper_limit>10</upper_limit>
    <lower_stiffness>10</lower_stiffness><lower_limit>-20</lower_limit><damping>1</damping>
    <transition>5</transition></CoordinateLimitForce>"""
    model, report = read(ForceSet=force)
    assert report.loaded
    model = model.edit("leg", com=(0, 0, 0))  # 1 kg m² about z
    degree = np.pi / 180
    for q, v in itertools.product((-0.5, -0.38, 0.0, 0.2, 0.9), (0.0, 0.3)):
        up, low = np.clip([(q / degree - 10) / 5, (-20 - q / degree) / 5], 0, 1)
        up, low = (s**3 * (10 - 15 * s + 6 * s**2) for s in (up, low))
        expected = 10 * low * (-20 - q / degree) - 20 * up * (q / degree - 10)
        expected -= 1 / degree * (up + low) * v
        run = pg.simulate(model, t_end=1e-6, q={"leg": (q,)}, v={"leg": (v,)})
        assert run.vdot[0, 0] == pytest.approx(expected, rel=1e-10, abs=1e-10)


def test_springs_and_lines_have_their_counterparts(read):
    forces = """<PointToPointSpring name="spring"><socket_body1>/ground</socket_body1>
    <socket_body2>/bodyset/leg</socket_body2><point1>0 1 0</point1><point2>0 -1 0.1</point2>
    <stiffness>30</stiffness><rest_length>0.4</rest_length></PointToPointSpring>
    <SpringGeneralizedForce name="rubber"><coordinate>flexion</coordinate><stiffness>5</stiffness>
    <rest_length>0.1</rest_length><viscosity>0.5</viscosity></SpringGeneralizedForce>
    <CoordinateActuator name="drive"><coordinate>flexion</coordinate>
    <optimal_force>40</optimal_force><min_control>-1</min_control><max_control>Inf</max_control>
    </CoordinateActuator>"""
    line = """<PointOnLineConstraint name="rail"><socket_line_body>/ground</socket_line_body>
    <socket_follower_body>/bodyset/leg</socket_follower_body>
    <line_direction_vec>0 1 0</line_direction_vec><point_on_line>0 0 0</point_on_line>
    <point_on_follower>0.1 0 0</point_on_follower></PointOnLineConstraint>"""
    model, report = read(ForceSet=forces, ConstraintSet=line)
    assert report.loaded
    leg, (spring, drive), (rail,) = model.body("leg"), model.forces, model.constraints
    assert (leg.stiffness, leg.rest, leg.damping) == ((5.0,), (0.1,), (0.5,))
    assert (spring.body, spring.point, spring.other_point) == ("leg", (0, -1, 0.1), (0, 1, 0))
    assert (spring.stiffness, spring.rest) == (30.0, 0.4)
    assert (drive.gear, drive.input_low, drive.input_high) == (40.0, -1.0, None)
    assert (rail.kind, rail.point, rail.other_axis) == ("line", (0.1, 0, 0), (0, 1, 0))


def test_parts_without_a_counterpart_are_named_and_noted_if_they_act(read):
    forces = '<HuntCrossleyForce name="heel"/><HuntCrossleyForce name="toe"/>'
    off = '<HuntCrossleyForce name="off"><appliesForce>false</appliesForce></HuntCrossleyForce>'
    model, report = read(ForceSet=forces + off)
    assert not report.loaded
    assert_names("\n".join(model.lost), "HuntCrossleyForce", "heel", "toe")
    assert "off" not in "\n".join(model.lost)
    assert_names(str(report), "off")
    assert read(ForceSet=off)[1].loaded


VTP = """<VTKFile type="PolyData"><PolyData><Piece NumberOfPoints="4" NumberOfPolys="1"><Points>
<DataArray format="ascii" NumberOfComponents="3">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points><Polys>
<DataArray Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray Name="offsets" format="ascii">4</DataArray></Polys></Piece></PolyData></VTKFile>"""


def test_pictures_are_shapes_that_do_not_touch_and_missing_files_are_named(
    read, tmp_path, monkeypatch
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    (tmp_path / "Geometry").mkdir()
    (tmp_path / "Geometry" / "bone.vtp").write_text(VTP)
    pictures = """<attached_geometry><Mesh><mesh_file>bone.vtp</mesh_file>
    <scale_factors>1 2 1</scale_factors><Appearance><color>1 0 0</color></Appearance></Mesh>
    <Mesh><mesh_file>lost.vtp</mesh_file></Mesh><Brick><half_lengths>1 2 3</half_lengths></Brick>
    <Cylinder><radius>0.1</radius><half_height>0.4</half_height></Cylinder></attached_geometry>"""
    model, report = read(bodies=LEG.replace("</Body>", f"{pictures}</Body>"))
    bone, brick, cylinder = model.body("leg").shapes
    assert {shape.role for shape in (bone, brick, cylinder)} == {"visual"}
    assert (bone.scale, bone.colour, brick.size) == ((1, 2, 1), (1, 0, 0), (2, 4, 6))
    assert (cylinder.length, cylinder.radius) == (0.8, 0.1)
    assert abs(matrix(cylinder.rotation)[1, 2]) == pytest.approx(1)  # along y
    assert report.loaded
    assert_names(str(report), "lost.vtp", "roots")


MUSCLE = """<Thelen2003Muscle name="hamstring"><GeometryPath name="path"><PathPointSet><objects>
<PathPoint name="a"><socket_parent_frame>/ground</socket_parent_frame><location>0.1 0.2 0</location>
</PathPoint><PathPoint name="b"><socket_parent_frame>/ground</socket_parent_frame>
<location>0.1 0 0</location></PathPoint><PathPoint name="c">
<socket_parent_frame>/bodyset/leg</socket_parent_frame><location>0.02 -0.8 0</location></PathPoint>
</objects></PathPointSet><PathWrapSet><objects><PathWrap name="w"><wrap_object>round</wrap_object>
<range>-1 -1</range></PathWrap></objects></PathWrapSet></GeometryPath>
<max_isometric_force>800</max_isometric_force><optimal_fiber_length>0.1</optimal_fiber_length>
<tendon_slack_length>0.5</tendon_slack_length><KshapePassive>4</KshapePassive>
<default_activation>0.3</default_activation></Thelen2003Muscle>"""
WRAP = """<WrapObjectSet><objects><WrapCylinder name="round"><quadrant>{}</quadrant>
<translation>0 -0.3 0</translation><radius>0.05</radius><length>0.1</length></WrapCylinder>
</objects></WrapObjectSet></Body>"""


def test_a_muscle_has_its_numbers_and_its_path_over_the_nearest_span(read):
    leg = LEG.replace("</Body>", WRAP.format("-x"))
    controller = """<PrescribedController name="c"><actuator_list>hamstring</actuator_list>
    <FunctionSet name="ControlFunctions"><objects><Constant><value>0.4</value></Constant></objects>
    </FunctionSet></PrescribedController>"""
    model, report = read(bodies=leg, ForceSet=MUSCLE, ControllerSet=controller)
    assert report.loaded
    assert_names("\n".join(model.lost), "cylinders")
    (muscle,) = model.forces
    assert (muscle.model, muscle.f_max, muscle.l_opt, muscle.l_slack) == (
        "thelen2003",
        800,
        0.1,
        0.5,
    )
    assert (muscle.shape, muscle.start, muscle.excitation) == ({"passive_shape": 4.0}, 0.3, 0.4)
    assert (muscle.body, muscle.point, muscle.other) == ("leg", (0.02, -0.8, 0), "ground")
    obstacle, point = muscle.via
    assert (obstacle.point, obstacle.radius, obstacle.axis) == ((0, -0.3, 0), 0.05, (0, 0, 1))
    assert obstacle.side == pytest.approx((-0.1, -0.3, 0))
    assert (point.body, point.point) == ("ground", (0.1, 0, 0))


RANGED = """<socket_coordinate>/jointset/hip/flexion</socket_coordinate><range>0 1</range>
</ConditionalPathPoint>"""
CUBIC = """<socket_x_coordinate>/jointset/hip/flexion</socket_x_coordinate><x_location>
<PolynomialFunction><coefficients>{}</coefficients></PolynomialFunction></x_location><y_location>
<Constant><value>-0.8</value></Constant></y_location></MovingPathPoint>"""


def test_a_conditional_point_counts_in_its_range_and_its_jumps_are_told(read):
    force = MUSCLE.replace('PathPoint name="b"', 'ConditionalPathPoint name="b"')
    force = force.replace("0.1 0 0</location></PathPoint>", f"0.1 0 0</location>{RANGED}")
    leg = LEG.replace("</Body>", WRAP.format("all"))
    model, report = read(bodies=leg, ForceSet=force)
    assert report.loaded
    (muscle,) = model.forces
    (when,) = [via.when for via in muscle.via if via.radius is None]
    assert (when.body, when.coordinate, when.low, when.high) == ("leg", 0, 0.0, 1.0)
    (told,) = [str(x) for x in report.of("warning") if "jumps by" in str(x)]
    assert_names(told, "'hamstring'", "mm", "'leg'", "is 0", "is 1")


@pytest.mark.parametrize(("powers", "loaded"), [("0.2 0.1 0.02", True), ("1 0 0 0", False)])
def test_a_moving_point_has_shifts_of_splines_and_parabolas(read, powers, loaded):
    force = MUSCLE.replace('PathPoint name="c"', 'MovingPathPoint name="c"')
    place = "<location>0.02 -0.8 0</location></PathPoint>"
    force = force.replace(place, CUBIC.format(powers))
    leg = LEG.replace("</Body>", WRAP.format("all"))
    model, report = read(bodies=leg, ForceSet=force)
    assert report.loaded == loaded
    if loaded:
        (muscle,) = model.forces
        (shift,) = muscle.shifts
        assert (muscle.point, shift.along) == ((0.0, -0.8, 0.0), (1.0, 0.0, 0.0))
        assert shift.curve.coefficients == (0.02, 0.1, 0.2)
    else:
        assert_names("\n".join(model.lost), "moving", "degree 3", "hamstring")


EGG = """<WrapObjectSet><objects><WrapEllipsoid name="round"><quadrant>all</quadrant>
<xyz_body_rotation>0.3 -0.2 0.5</xyz_body_rotation><translation>0 -0.3 0</translation>
<dimensions>0.08 0.05 0.04</dimensions></WrapEllipsoid></objects></WrapObjectSet></Body>"""
# flexion [rad], and the length of OpenSim 4.6 [m]
OVER_EGG = (
    (-0.6, 1.0070034014121996), (0.1, 1.0017989793402), (0.6, 0.9832791600405496),
    (0.9, 0.9685859354920358),
)  # fmt: skip


def test_a_path_over_an_ellipsoid_is_no_longer_than_that_of_opensim(read):
    """OpenSim's own lengths and moment arms over ellipsoids disagree by up to 1e-3 m."""
    muscle = MUSCLE.replace("0.1 0 0<", "0.02 0.05 0.01<").replace("0.1 0.2 0<", "0.03 0.2 0<")
    model, report = read(bodies=LEG.replace("</Body>", EGG), ForceSet=muscle)
    assert report.loaded
    assert_names("\n".join(model.lost), "ellipsoids")
    obstacle, _ = model.forces[0].via
    assert (obstacle.radii, obstacle.radius) == ((0.08, 0.05, 0.04), None)
    np.testing.assert_allclose(matrix(obstacle.rotation), turned((0.3, -0.2, 0.5)), atol=1e-15)
    mech = pg.Mechanism(model)
    for q, expected in OVER_EGG:
        assert -2e-5 < mech.path_length([q])[0] - expected < 2e-7


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        ('PathPoint name="a"', 'ConditionalPathPoint name="a"', "conditional point at an end"),
        ("Thelen2003Muscle", "Schutte1993Muscle_Deprecated", "Schutte1993Muscle"),
    ],
)
def test_a_muscle_that_has_no_counterpart_is_a_named_loss(read, old, new, fact):
    force = MUSCLE.replace(old, new)
    if "Conditional" in new:
        force = force.replace("0.2 0</location>\n</PathPoint>", f"0.2 0</location>{RANGED}")
    leg = LEG.replace("</Body>", WRAP.format("all"))
    model, report = read(bodies=leg, ForceSet=force)
    assert not report.loaded
    assert not model.forces
    assert_names("\n".join(model.lost), fact, "hamstring")


ALONG = """<{0} name="m"><GeometryPath name="path"><PathPointSet><objects><PathPoint name="a">
<socket_parent_frame>/ground</socket_parent_frame><location>0 0 0</location></PathPoint>
<PathPoint name="b"><socket_parent_frame>/bodyset/leg</socket_parent_frame>
<location>0 0 0</location></PathPoint></objects></PathPointSet></GeometryPath>
<max_isometric_force>500</max_isometric_force><optimal_fiber_length>0.1</optimal_fiber_length>
<tendon_slack_length>0.15</tendon_slack_length>{1}</{0}>"""
SLIDER = HIP.replace("PinJoint", "SliderJoint")
MILLARD, DEGROOTE = "Millard2012EquilibriumMuscle", "DeGrooteFregly2016Muscle"
RIGID = "<ignore_tendon_compliance>true</ignore_tendon_compliance>"


def curve(name, **numbers):
    inside = "".join(f"<{key}>{value}</{key}>" for key, value in numbers.items())
    return f"<{name}Curve name='c'>{inside}</{name}Curve>"


CURVES = (
    curve(
        "TendonForceLength", strain_at_one_norm_force=0.06, stiffness_at_one_norm_force=30,
        norm_force_at_toe_end=0.5, curviness=0.7,
    )
    + curve(
        "FiberForceLength", strain_at_zero_force=0.05, strain_at_one_norm_force=0.6,
        stiffness_at_low_force=0.3, stiffness_at_one_norm_force=5, curviness=0.5,
    )
    + curve(
        "ForceVelocity", concentric_slope_at_vmax=0.1, concentric_slope_near_vmax=0.3,
        isometric_slope=4, eccentric_slope_at_vmax=0.1, eccentric_slope_near_vmax=0.2,
        max_eccentric_velocity_force_multiplier=1.5, concentric_curviness=0.5,
        eccentric_curviness=0.7,
    )
)  # fmt: skip
PASSIVE = "<ignore_passive_fiber_force>true</ignore_passive_fiber_force>"


@pytest.mark.parametrize(
    ("kind", "numbers", "length", "speed", "activation", "tension"),
    [  # tensions of OpenSim 4.6 [N]
        (MILLARD, CURVES, 0.28, 0.0, 0.3, 169.1633474704156),
        (MILLARD, CURVES, 0.31, 0.0, 0.1, 354.0488671580586),
        (MILLARD, CURVES + RIGID, 0.255, -0.5, 0.5, 27.461292278943297),
        (MILLARD, CURVES + RIGID, 0.255, 0.5, 0.5, 374.3926984566449),
        (DEGROOTE, PASSIVE, 0.29, 0.0, 0.3, 62.578670658695046),
        (DEGROOTE, RIGID, 0.255, -0.2, 0.5, 147.96057621130905),  # without damping
    ],
)
def test_the_numbers_of_a_muscle_give_the_tension_of_opensim(
    read, kind, numbers, length, speed, activation, tension
):
    """Bounds as in tests/core/test_muscles.py: curves of Millard have there 1e-5."""
    model, report = read(joints=SLIDER, ForceSet=ALONG.format(kind, numbers))
    assert report.loaded, report
    model = model.edit("m", start=activation).edit("leg", q=(length,), v=(speed,))
    run = pg.simulate(model, t_end=1e-6, frames=2)
    assert run.tension["m"][0] == pytest.approx(tension, rel=1e-5)


def test_a_muscle_without_numbers_has_those_of_opensim(read):
    forces = "".join(
        ALONG.format(kind, "").replace('"m"', f'"{name}"')
        for name, kind in (("t", "Thelen2003Muscle"), ("m", MILLARD), ("d", DEGROOTE))
    )
    model, report = read(joints=SLIDER, ForceSet=forces)
    assert report.loaded
    names = "start", "weakest", "damping", "rise", "fall", "fastest"
    assert [tuple(map(f.of_model, names)) for f in model.forces] == [
        (0.05, 0.01, 0.0, 0.015, 0.05, 10.0),
        (0.05, 0.01, 0.1, 0.01, 0.04, 10.0),
        (0.5, 0.0, 0.0, 0.015, 0.06, 10.0),
    ]


def test_the_steepness_of_an_activation_is_that_of_opensim(read):
    """The rate at u = 0.9 and a = 0.5 in OpenSim 4.6, in a process of its own."""
    steep = "<activation_dynamics_smoothing>3</activation_dynamics_smoothing>"
    model, report = read(joints=SLIDER, ForceSet=ALONG.format(DEGROOTE, steep))
    assert report.loaded
    model = model.edit("m", excitation=0.9).edit("leg", q=(0.25,))
    a = pg.simulate(model, t_end=2e-5, frames=3, method="rk4", step=1e-5)["activation.m"]
    rate = (4 * a[1] - 3 * a[0] - a[2]) / 2e-5  # its error is below 1e-6 of it
    assert rate == pytest.approx(20.252088278912343, rel=1e-5)


def test_names_of_old_versions_are_those_of_new_ones_as_in_opensim(read):
    old = "<pennation_angle>0.15</pennation_angle><Vmax>15</Vmax><Vmax0>5</Vmax0>"
    force = ALONG.format("Thelen2003Muscle", f"{old}<damping>0.05</damping>")
    model, report = read(version=20300, joints=SLIDER, ForceSet=force)
    assert report.loaded
    assert (model["m"].pennation, model["m"].of_model("fastest")) == (0.15, 10.0)


@pytest.mark.parametrize(
    ("kind", "numbers", "fact"),
    [
        (MILLARD, "<ignore_activation_dynamics>true</ignore_activation_dynamics>", ""),
        (
            MILLARD,
            "<pennation_angle_at_optimal>0.2</pennation_angle_at_optimal>"
            "<maximum_pennation_angle>0.8</maximum_pennation_angle>",
            "maximum_pennation_angle 0.8",
        ),
        (MILLARD, curve("ForceVelocity", roughness=3), "ForceVelocityCurve/roughness 3"),
        ("Thelen2003Muscle", "<fatigue>fast</fatigue>", "fatigue fast"),
        ("PathActuator", "<lag>0.1</lag>", "lag 0.1"),
    ],
)
def test_numbers_of_a_muscle_that_are_not_read_are_a_named_loss(read, kind, numbers, fact):
    model, report = read(joints=SLIDER, ForceSet=ALONG.format(kind, numbers))
    assert len(model.forces) == 1
    assert not report.loaded
    assert_names("\n".join(model.lost), kind, fact or "ignore_activation_dynamics true", "'m'")


@pytest.mark.parametrize(
    "numbers",
    [
        "<ignore_activation_dynamics>false</ignore_activation_dynamics>",
        "<pennation_angle_at_optimal>0.2</pennation_angle_at_optimal>"
        "<maximum_pennation_angle>1.47063</maximum_pennation_angle>",  # as OpenSim writes it
        "<maximum_pennation_angle>0.8</maximum_pennation_angle>",  # no effect on a straight fibre
        "<min_control>0.2</min_control><optimal_force>3</optimal_force>",  # nor of these
        curve("ActiveForceLength", minimum_value=0.2),  # nor of this with damping
        "<MuscleFirstOrderActivationDynamicModel><minimum_activation>0</minimum_activation>"
        "</MuscleFirstOrderActivationDynamicModel>",  # of version 3
    ],
)
def test_numbers_of_a_muscle_without_effect_are_no_loss(read, numbers):
    model, report = read(joints=SLIDER, ForceSet=ALONG.format(MILLARD, numbers))
    assert report.loaded
    assert not model.lost


# -- bad input -------------------------------------------------------------------------------------

SPLINED = custom("a b", rotation1=("a", "0 0 1", LINE), translation1=("b", "1 0 0", BEND))
TWICE = custom("a", rotation1=("a b", "0 0 1", LINE))
BETWEEN = custom(
    "a b", rotation1=("a", "0 0 1", LINE), rotation2=("b", "0 1 0", LINE),
    rotation3=("a", "1 0 0", LINE),
)  # fmt: skip
BENT = "<PiecewiseLinearFunction><x>0 1 2</x><y>0 1 0</y></PiecewiseLinearFunction>"
BAD = {
    "version 1": ({"version": 10902}, "10902", "20000", "save it again"),
    "no joint of the list": (
        {"joints": HIP.replace("PinJoint", "ScapulothoracicJoint")},
        "line 2", "hip", "ScapulothoracicJoint", "CustomJoint",
    ),
    "ellipsoid": (
        {"joints": HIP.replace("PinJoint", "EllipsoidJoint")}, "hip", "EllipsoidJoint",
    ),
    "missing parent": (
        {"joints": HIP.replace("/ground", "/bodyset/hips")},
        "hip", "parent_frame", "'/bodyset/hips'", "leg",
    ),
    "frame without a parent": (
        {"joints": HIP.replace("</PinJoint>", """<frames><PhysicalOffsetFrame name="f"/></frames>
         </PinJoint>""").replace("/bodyset/leg", "f")}, "hip", "child_frame", "''",
    ),
    "own frame": (
        {"joints": HIP.replace("</PinJoint>", """<frames><PhysicalOffsetFrame name="f">
         <socket_parent>f</socket_parent></PhysicalOffsetFrame></frames></PinJoint>""").replace(
            "/bodyset/leg", "f")}, "hip", "child_frame", "'f'", "each other",
    ),
    "own parent": (
        {"joints": HIP.replace("/ground", "/bodyset/leg")}, "hip", "leg", "ground",
    ),
    "two joints": ({"joints": 2 * HIP}, "hip", "leg", "WeldConstraint"),
    "two coordinates": ({"joints": TWICE}, "hip", "rotation1", "2 coordinates", "a, b"),
    "rotation between": ({"joints": BETWEEN}, "hip", "'a'", "'b'", "between"),
    "idle coordinate": (
        {"joints": custom("a b", rotation1=("a", "0 0 1", LINE))}, "hip", "coordinates", "'b'",
    ),
    "corners": (
        {"joints": custom("a", rotation1=("a", "0 0 1", BENT))}, "PiecewiseLinear", "SimmSpline",
    ),
    "unknown function": (
        {"joints": custom("a", rotation1=("a", "0 0 1", "<Sine/>"))}, "Sine", "SimmSpline",
    ),
    "comma": ({"bodies": LEG.replace("0 -1 0<", "0,1 0 0<")}, "leg", "mass_center", "'0,1 0 0'"),
    "two of three": (
        {"bodies": LEG.replace("0 -1 0<", "1 0<")}, "leg", "mass_center", "3", "'1 0'",
    ),
    "negative mass": ({"bodies": LEG.replace("<mass>2", "<mass>-2")}, "leg", "mass", "-2"),
    "two bodies": ({"bodies": 2 * LEG}, "leg", "name", "line 1"),
    "not XML": ({"bodies": "<Body>"}, "not XML"),
    "descending spline": (
        {"joints": custom("a", rotation1=("a", "0 0 1", BEND.replace("-1 0", "1 0")))},
        "x", "ascending",
    ),
    "reversed": (
        {"joints": HIP.replace("<coordinates>", "<reverse>true</reverse><coordinates>")},
        "hip", "reverse",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_a_bad_file_is_refused_with_its_place_and_a_remedy(read, what):
    parts, *facts = BAD[what]
    with pytest.raises(pg.FileError) as refused:
        read(**parts)
    assert_names(str(refused.value), "m.osim", *facts)


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("<robot name='r'/>", ["<robot>", "OpenSimDocument"]),
        ("<OpenSimDocument Version='40000'/>", ["<Model>"]),
        ("<OpenSimDocument><Model/></OpenSimDocument>", ["version", "20000"]),
    ],
)
def test_a_file_without_a_model_is_told_apart(read, text, facts):
    with pytest.raises(pg.FileError) as refused:
        read(text)
    assert_names(str(refused.value), "m.osim", *facts)


def test_other_units_are_read_as_metres_with_a_warning(read):
    text = document().replace('name="m">', 'name="m"><length_units>mm</length_units>')
    _, report = read(text)
    assert_names("\n".join(str(x) for x in report.of("warning")), "length_units", "'mm'", "metres")

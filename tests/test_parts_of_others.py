"""Parts of a model as users of other programs write them."""

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("given", [(1, 2, 2.5), [1.0, 2.0, 2.5], np.array([1, 2, 2.5])])
def test_three_moments_are_the_diagonal_of_the_inertia(given):
    body = pg.Body(name="a", inertia=given)
    assert body.inertia == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))
    assert pg.Model(bodies=[body]).edit("a", inertia=given).bodies[0] == body


@pytest.mark.parametrize(
    "given", [(1, 2), (1, 2, 3, 4), (1, 2, 4), (1, -1, 1), (1, 2, "x"), 3.0, True]
)
def test_moments_that_no_body_has_are_refused(given):
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body(name="a", inertia=given)


ARM = pg.Body("arm", axis="y", mass=2.0, com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.01))
HAND = pg.Body("hand", "arm", axis="y", com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.01), link=(0, 0, -1))
TWO = pg.Model(bodies=[ARM, HAND])
Y, Z = (0, 1, 0), (0, 0, 1)
SPHERE = pg.Shape("sphere", radius=0.1)
LOOSE = pg.Body("ball", joint="free", shape=SPHERE, derived=("inertia",))


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: pg.Body("a", parent=ARM), lambda: pg.Body("a", parent="arm")),
        (lambda: pg.Body("a", offset=(0, 0, 1)), lambda: pg.Body("a", link=(0, 0, 1))),
        (lambda: pg.RigidBody("a", joint="6dof"), lambda: pg.Body("a", joint="free")),
        (lambda: pg.Sphere(radius=0.1), lambda: SPHERE),
        (lambda: pg.Cube(size=(1, 1, 1)), lambda: pg.Shape("box", size=(1, 1, 1))),
        (lambda: pg.Loop(body_a="hand", point_a=(0, 0, -1), body_b="arm", point_b=(1, 0, 0)),
         lambda: pg.Point(body="hand", point=(0, 0, -1), other="arm", other_point=(1, 0, 0))),
        (lambda: pg.Contact(body="ball", ground=True, mu=0.1),
         lambda: pg.Contact(body="ball", friction=0.1)),
        (lambda: pg.Model([ARM], springs=[pg.Spring(body_a="ground", body_b=ARM, point_b=Z, k=9)]),
         lambda: pg.Model([ARM], forces=[pg.Spring(body="arm", point=Z, stiffness=9)])),
        (lambda: pg.Model([ARM], dampers=pg.Damper("s", "world", "arm", point_a=Z, c=9)),
         lambda: pg.Model([ARM], forces=[pg.Spring("s", body="arm", point=(0, 0, 0),
                                                   other_point=Z, damping=9)])),
        (lambda: pg.Model([ARM], joints=[pg.Revolute("r", "world", "arm", axis_a=(0, 1, 0))]),
         lambda: pg.Model([ARM], constraints=[pg.Revolute("r", body="arm", other_axis=Y)])),
        (lambda: pg.Model([LOOSE], contacts=[pg.Contact("c", "floor", "ball")]),
         lambda: pg.Model([LOOSE], contacts=[pg.Contact("c", "ball", "ground")])),
        (lambda: pg.Model([ARM, HAND], gears=[pg.Gear("g", "arm", "hand", ratio=2)],
                          motors=[pg.Motor("m", "arm")]),
         lambda: pg.Model([ARM, HAND], constraints=[pg.Gear("g", "arm", "hand", ratio=2)],
                          forces=[pg.Motor("m", "arm")])),
        (lambda: pg.Model([ARM, pg.Motor("m", "arm"), HAND]),
         lambda: pg.Model([ARM, HAND], forces=[pg.Motor("m", "arm")])),
    ],
)  # fmt: skip
def test_a_part_by_other_names_is_the_same_part(theirs, ours):
    assert theirs() == ours()


URDF = """<robot name="r"><link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""


@pytest.mark.parametrize(
    "words", [{"base": "free"}, {"floating": True}, {"fixed_base": False}, {"useFixedBase": False}]
)
def test_the_root_of_a_urdf_file_floats_if_it_shall(words, tmp_path):
    (tmp_path / "r.urdf").write_text(URDF)
    model = pg.load(tmp_path / "r.urdf", **words)
    assert (model.body("base").joint, pg.load(tmp_path / "r.urdf").body("base").joint) == (
        "free",
        "weld",
    )
    with pytest.raises(pg.InputError, match="free"):
        pg.load("double_pendulum", **words)
    for roots in ("free", {"base": "free"}, [tmp_path / "r.urdf"]):
        with pytest.raises(pg.InputError, match="roots"):
            pg.load(tmp_path / "r.urdf", roots=roots)


def test_a_ground_that_is_added_replaces_that_of_the_model():
    assert TWO.add(pg.Ground(friction=0.3)) == TWO.replace(ground=pg.Ground(friction=0.3))


@pytest.mark.parametrize(
    ("theirs", "ours"),
    [
        (lambda: pg.Gear("arm", HAND, ratio=2), lambda: pg.Gear(body="arm", other="hand", ratio=2)),
        (lambda: pg.Point("arm", "hand", p1=(0, 0, 1)),
         lambda: pg.Point(body="arm", other="hand", point=(0, 0, 1))),
        (lambda: pg.Spring("a", "b", length=1.0), lambda: pg.Spring(body="a", other="b", rest=1.0)),
        (lambda: pg.Sphere(0.1), lambda: SPHERE),
        (lambda: pg.Box(1, 2, 3), lambda: pg.Shape("box", size=(1, 2, 3))),
        (lambda: pg.Box((1, 2, 3)), lambda: pg.Shape("box", size=(1, 2, 3))),
        (lambda: pg.Cylinder(0.1, 2.0), lambda: pg.Shape("cylinder", radius=0.1, length=2.0)),
    ],
)  # fmt: skip
def test_bodies_and_sizes_may_be_given_by_position(theirs, ours):
    assert theirs() == ours()


def test_an_inertia_of_zero_is_that_of_a_point_mass():
    for zero in (0, 0.0):
        assert pg.Body("a", inertia=zero) == pg.Body("a", inertia=(0, 0, 0))
    with pytest.raises(pg.ModelError, match="inertia"):
        pg.Body("a", inertia=False)  # pyright: ignore[reportArgumentType]


def test_a_spring_without_a_first_body_is_fixed_to_the_ground():
    spring = pg.Spring(body_a=None, body_b="rod", length=0.2)
    model = pg.Model(bodies=[pg.Body(name="rod", axes=(0, 1, 0), com=(0, 0, -1))])
    for added in (model.add(spring), model.replace(forces=[spring])):
        assert (added.forces[0].body, added.forces[0].other) == ("rod", "ground")


def test_a_part_in_a_dictionary_may_have_words_of_other_programs():
    bodies = [pg.Body(name=name, com=(1, 0, 0)) for name in "ab"]
    given = {"name": "x", "type": "gear", "joint1": "a", "joint2": "b", "ratio": 2.0}
    (gear,) = pg.Model(bodies=bodies, constraints=[given]).constraints
    assert (gear.kind, gear.body, gear.other) == ("gear", "a", "b")


FREE = {"joint": "free", "inertia": (0.1, 0.2, 0.15), "v": (1, 2, 3, 0.1, 0.2, 0.3)}
UPPER = pg.Body("top", axis="y", com=(0, 0, -0.5), inertia=(0.1, 0.1, 0.1), q=0.3, v=0.5,
                rotation=(0.9, 0.3, 0.3, 0.1))  # fmt: skip
LOWER = pg.Body("low", "top", rotation=(0.7, 0.1, 0.5, 0.5), q=(0.3, 0.2, 0.1, 0.5, 0.5, -0.5, 0.5),
                **FREE)  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "as_first", "as_other"),
    [
        (pg.Point, {"point": "P"}, {"point": "p", "other_point": "P"}),
        (pg.Weld, {"point": "P"}, {"point": "p", "other_point": "P"}),
        (pg.Revolute, {"point": "P"}, {"point": "p", "other_axis": Z}),
        (pg.Revolute, {"point": "P", "axis": Y}, {"point": "p", "other_axis": Y}),
        (pg.Cylindrical, {"point": "P", "other_axis": Y}, {"point": "p", "axis": Y}),
        (pg.Universal, {"point": "P"}, {"point": "p", "axis": "x", "other_axis": Y}),
        (pg.Distance, {"other_point": Z}, {"point": Z, "other_point": (0, 0, 0)}),
        (pg.Orientation, {}, {}),
        (pg.Torsion, {"axis": (1, 2, 3), "stiffness": 5.0, "rest": 0.4, "damping": 0.2},
         {"axis": "-a", "stiffness": 5.0, "rest": 0.4, "damping": 0.2}),
        (pg.Spring, {"point": "P", "stiffness": 5.0, "rest": 0.1},
         {"point": (0, 0, 0), "other_point": "P", "stiffness": 5.0, "rest": 0.1}),
    ],
)  # fmt: skip
def test_the_ground_may_be_the_first_body_of_a_part(kind, as_first, as_other):
    """The point P of the ground is p of the body, and x and a are directions of it."""
    model = pg.Model([UPPER, LOWER])
    mech = pg.Mechanism(model)
    place, turn = mech.pose(mech.home()[0], "low")
    at_zero = mech.pose([0, 0, 0, 0, 1, 0, 0, 0], "low")[1]
    P = np.array((0.3, -0.2, 0.4))
    known = {"P": P, "p": turn.T @ (P - place), "x": turn[0], "-a": -at_zero.T @ (1, 2, 3)}
    one, same = (
        model.add(kind("part", **ends, **{k: known.get(str(x), x) for k, x in given.items()}))
        for ends, given in (({"body": "ground", "other": "low"}, as_first),
                            ({"body": "low", "other": "ground"}, as_other))
    )  # fmt: skip
    first, second = (pg.Mechanism(each) for each in (one, same))
    q, v, _ = second.assemble()
    found, wanted = (each.constrained_dynamics(q, v)[0] for each in (first, second))
    np.testing.assert_allclose(found, wanted, atol=1e-10, rtol=1e-10)


@pytest.mark.parametrize(
    "part",
    [
        pg.Plane("p", "ground", "arm", axis=(0, 0, 1)),
        pg.Line("p", "ground", "arm", other_axis=(0, 0, 1)),
        pg.Bushing("p", body="ground", other="arm", stiffness=(1,) * 6),
        pg.Rolling("p", body="ground", other="arm", radius=1.0),
        pg.Contact("p", "ground", "arm", points=((0, 0, 0),)),
    ],
)
def test_a_part_whose_ends_differ_is_not_turned_round(part):
    with pytest.raises(pg.ModelError, match=r"'p', body: the ground.*body='arm', other='ground'"):
        pg.Model([ARM], parts=[part])

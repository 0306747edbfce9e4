"""URDF in and out: the part for each element, the report on it, and hostile files."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pgraph_core as pg
from pgraph_app.cli.main import main
from pgraph_core.formats.conversion import nearest_inertia
from pgraph_core.rotation import matrix

pytestmark = pytest.mark.quick

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/></inertial>'
)


def link(name: str, inside: str = INERTIAL) -> str:
    return f'<link name="{name}">{inside}</link>\n'


def joint(name: str, parent: str, child: str, inside: str = "", kind: str = "revolute") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>\n'


def robot(*parts: str) -> str:
    return f'<?xml version="1.0"?>\n<robot name="arm">\n{"".join(parts)}</robot>\n'


def read(tmp_path: Path, *parts: str, **options) -> tuple[pg.Model, pg.Report]:
    path = tmp_path / "arm.urdf"
    path.write_text(robot(*parts))
    return pg.read_urdf(path, **options)


TWO = (
    link("base"),
    link("upper"),
    link("lower"),
    joint("shoulder", "base", "upper", '<origin xyz="0 0 1" rpy="0.3 0.2 0.1"/><axis xyz="0 2 0"/>'
          '<limit lower="-1" upper="2" effort="30" velocity="4"/>'
          '<dynamics damping="0.5" friction="0.25"/>'),
    joint("slide", "upper", "lower", '<axis xyz="0 0 1"/>', "prismatic"),
)  # fmt: skip


def test_links_joints_limits_motors(tmp_path):
    model, report = read(tmp_path, *TWO)
    assert [b.name for b in model.bodies] == ["base", "upper", "lower"]
    base, upper, lower = model.bodies
    assert (base.joint, upper.joint, lower.joint) == ("weld", "revolute", "prismatic")
    np.testing.assert_allclose(upper.link, (0, 0, 1))
    turn = Rotation.from_euler("xyz", (0.3, 0.2, 0.1)).as_matrix()
    np.testing.assert_allclose(matrix(upper.rotation), turn, atol=1e-15)
    np.testing.assert_allclose(np.diag(upper.inertia), (0.2, 0.1, 0.25), atol=1e-15)
    assert (upper.limits, upper.speed_limit) == (((-1.0, 2.0),), (4.0,))
    assert (upper.damping, upper.friction) == ((0.5,), (0.25,))
    (drive,) = model.forces
    assert isinstance(drive, pg.Motor)
    assert (drive.name, drive.body, drive.torque_limit) == ("shoulder", "upper", 30.0)
    assert report.loaded
    assert any("velocity" in e.text for e in report.of("left out"))
    places = [e.where for e in report.entries if e.part == "lower"]
    assert places == ["arm.urdf, line 7, joint 'slide'"]  # it has no limits


def test_the_root_is_welded_floats_or_is_the_world(tmp_path):
    free, _ = read(tmp_path, *TWO, base="free")
    assert free.bodies[0].joint == "free"
    model, _ = read(
        tmp_path, '<link name="world"/>', joint("fix", "world", "base", kind="fixed"), *TWO
    )
    assert [b.parent for b in model.bodies] == ["ground", "base", "upper"]
    with pytest.raises(pg.InputError, match=r"base.*'fixed'.*'free'"):
        read(tmp_path, *TWO, base="floating")


@pytest.mark.parametrize(
    ("inside", "fact", "acts"),
    [("<origin/>", "<origin>", True), ("<colision/>", "<collision>", True),
     ("<sensor/>", "<sensor>", False), ("<material/>", "<material>", False),
     ("<visal/>", "<visual>", False)],
)  # fmt: skip
def test_elements_that_are_misplaced_or_misspelt_are_named(tmp_path, inside, fact, acts):
    _, report = read(tmp_path, link("base", inside), *TWO[1:])
    (entry,) = [e for e in report.of("left out") if inside.strip("</>") in e.text]
    assert fact in entry.text
    assert entry.acts == acts


def test_extensions_of_bullet_are_read(tmp_path):
    """Blank lines before the declaration, limits the wrong way round, planes."""
    plane = '<collision><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/>'
    plane += '<geometry><plane normal="0 2 0"/></geometry></collision>'
    free = TWO[3].replace('lower="-1" upper="2"', 'lower="1" upper="-1"')
    path = tmp_path / "arm.urdf"
    path.write_text("\n \n" + robot(link("base", plane), *TWO[1:3], free, TWO[4]))
    model, report = pg.read_urdf(path)
    assert report.loaded
    assert not any(model.body("upper").limits)
    assert "arm.urdf, line 8, joint 'shoulder'" in {e.where for e in report.of("warning")}
    (box,) = model.body("base").shapes
    turn = matrix(box.rotation)
    np.testing.assert_allclose(turn[:, 2], (0, 1, 0), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(turn), 1)
    np.testing.assert_allclose(box.position, (1, -0.5, 0), atol=1e-15)
    assert box.size == (100, 100, 1)
    path.write_text(path.read_text().replace('"0 2 0"', '"0 0 0"'))
    with pytest.raises(pg.FileError, match="line 5, link 'base', normal"):
        pg.read_urdf(path)


@pytest.mark.parametrize(
    ("mimics", "told"),
    [
        ([("b", 0.5, 1)], None),
        ([("b", 2, 1), ("c", -1, 0)], None),  # a chain
        ([("b", 2, 1), ("a", 0.5, -0.5)], "follows"),
        ([("b", 2, 1), ("c", -4, 0), ("a", -0.125, 0.125)], "follows"),
        ([("b", 2, 1), ("a", 0.5, 0.5)], "no joint positions"),
        ([("b", 2, 1), ("a", -1, 1)], "held"),
        ([("b", 2, 1), ("c", 3, 1), ("a", -1, 4)], "held"),
    ],
)
def test_mimics_in_a_ring_are_named(tmp_path, mimics, told):
    """The warning agrees with the rank of the rows of the gears."""
    joints = [
        joint(name, "base", f"l{name}", kind="continuous", inside="".join(
            f'<mimic joint="{other}" multiplier="{ratio}" offset="{offset}"/>'
            for other, ratio, offset in mimics[k : k + 1]
        ))
        for k, name in enumerate("abc")
    ]  # fmt: skip
    model, report = read(tmp_path, *map(link, ("base", "la", "lb", "lc")), *joints)
    said = [e for e in report.of("warning") if "loop" in e.text]
    rows = np.array([
        [(g.body == f"l{n}") - g.ratio * (g.other == f"l{n}") for n in "abc"]
        for g in model.constraints if isinstance(g, pg.Gear)
    ])  # fmt: skip
    right = np.array([offset for *_, offset in mimics])
    assert (np.linalg.matrix_rank(rows) < len(rows)) == bool(told and "held" not in told)
    if told is None:
        assert not said
        return
    (entry,) = said
    assert told in entry.text
    q, *_ = np.linalg.lstsq(rows, right)
    assert (np.abs(rows @ q - right).max() > 0.1) == told.startswith("no joint positions")


def test_shapes_have_roles_colours_and_meshes_of_the_package(tmp_path):
    folder = tmp_path / "my_robot"
    for name in ("meshes", "urdf"):
        (folder / name).mkdir(parents=True)
    (folder / "package.xml").write_text("<package/>")
    tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (folder / "meshes" / "part.obj").write_text(tetrahedron)
    box = '<geometry><box size="1 2 3"/></geometry>'
    red = '<material name="red"><color rgba="1 0 0 0.5"/></material>'

    def mesh(name: str) -> str:
        return f'<geometry><mesh filename="{name}" scale="0.001 -0.001 0.002"/></geometry>'

    inside = (
        f"<visual>{box}{red}</visual><collision>{box}</collision>"
        f'<visual>{mesh("package://my_robot/meshes/part.obj")}<material name="red"/></visual>'
        f"<collision>{mesh('../meshes/part.obj')}</collision>"
        f"<visual>{mesh('package://my_robot/meshes/none.obj')}</visual>"
    )
    path = folder / "urdf" / "a.urdf"
    path.write_text(robot(red, link("base", inside)))
    model, report = pg.read_urdf(path)
    box, drawn, missing, touching = model.bodies[0].shapes
    assert (missing.role, missing.kind) == ("visual", "mesh")
    assert (box.kind, box.role, box.colour) == ("box", "both", (1, 0, 0))
    assert (drawn.role, drawn.scale, drawn.colour) == ("visual", (0.001, -0.001, 0.002), (1, 0, 0))
    assert (touching.role, touching.hull) == ("collision", "convex")
    assert drawn.file == touching.file == str(folder / "meshes" / "part.obj")
    assert report.loaded  # what is missing is only drawn
    (missing,) = (e for e in report.of("left out") if "none.obj" in e.text)
    assert missing.where.endswith("link 'base'")


def test_an_inertia_that_no_body_has_is_kept_and_its_repair_offered(tmp_path):
    wrong = INERTIAL.replace('izz="0.25"', 'izz="0.5"')
    parts = (link("base"), link("upper", wrong), joint("j", "base", "upper", kind="continuous"))
    model, report = read(tmp_path, *parts)
    np.testing.assert_allclose(np.linalg.eigvalsh(model.body("upper").inertia), (0.1, 0.2, 0.5))
    warning = next(e for e in report.of("warning") if e.part == "upper")
    assert warning.where == "arm.urdf, line 4, link 'upper'"
    assert report.loaded
    repaired = report.repaired(model, "upper").body("upper")
    assert not repaired.any_inertia
    moments = np.linalg.eigvalsh(repaired.inertia)
    np.testing.assert_allclose(moments[0] + moments[1], moments[2], rtol=1e-9)
    with pytest.raises(pg.ModelError, match="triangle"):
        model.edit("upper", any_inertia=False)
    with pytest.raises(pg.InputError, match="upper"):
        report.repaired(model, "base")
    saved = pg.Model.from_json(model.to_json())
    assert saved == model


def test_nearest_inertia_is_physical_and_not_farther_than_others():
    rng = np.random.default_rng(0)
    for _ in range(20):
        given = rng.normal(size=(3, 3))
        given = given + given.T
        found = np.array(nearest_inertia(given))
        moments = np.linalg.eigvalsh(found)
        assert moments[0] >= -1e-12
        assert moments[0] + moments[1] >= moments[2] - 1e-12
        S = rng.normal(size=(3, 3))
        S = S @ S.T * rng.uniform(0, 2)
        other = np.trace(S) * np.eye(3) - S  # of a body with these second moments
        near, far = np.linalg.norm(found - given), np.linalg.norm(other - given)
        assert near <= far + 1e-9
        closer = np.linalg.norm((0.99 * found + 0.01 * other) - given)
        assert near <= closer + 1e-9


TREE = [link("a"), link("b"), joint("j", "a", "b", kind="fixed")]
HOSTILE = {
    "<robot": "line 1",
    "<!DOCTYPE r [<!ENTITY a 'aa'><!ENTITY b '&a;&a;'>]><robot/>": "document type",
    "<!DOCTYPE r SYSTEM 'file:///etc/passwd'><robot/>": "document type",
    "<mujoco/>": "read_mjcf",
    "<robot/>": "link",
    "<a>" * 300: "nest",
    robot(*TREE, link("c")): r"'a' \(line 3\), 'c' \(line 6\)",
    robot(*TREE, joint("k", "b", "a", kind="fixed")): "0 root|cycle",
    robot(*TREE, link("c"), link("d"), joint("k", "c", "d"), joint("l", "d", "c")): "cycle",
    robot(*TREE, link("c"), joint("k", "c", "b"), joint("l", "a", "c")): "line 7, joint 'k'.*'j'",
    robot(*TREE, link("a")): "line 6, link 'a'.*line 3",
    robot(*TREE[:2], joint("j", "a", "b", '<axis xyz="0 0 nan"/>')): "finite.*nan",
    robot(link("a", INERTIAL.replace('"2"', '"1e999"'))): "mass.*'1e999'|value.*'1e999'",
    robot(link("a b\n")): "line 3|name",
    robot('<link name=""/>'): "line 3, link, name",
    f'<robot name="{"x" * 2_000_000}"/>': "attribute",
}  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_faults_are_named_with_their_place(tmp_path, text):
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(pg.PgraphError, match=f"bad.urdf.*({HOSTILE[text]})"):
        pg.read_urdf(path)


def equal(a, b) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[k], b[k]) for k in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(equal, a, b))
    return math.isclose(a, b, rel_tol=1e-13, abs_tol=1e-14) if isinstance(a, float) else a == b


def test_out_and_in_again_is_the_same_model(tmp_path):
    loop = (
        '<loop_joint name="closed" type="continuous"><link1 link="lower" xyz="0 0 1"/>'
        '<link2 link="base" xyz="1 0 0" rpy="0 0 0.5"/><axis xyz="0 1 0"/></loop_joint>'
    )
    place = '<origin xyz="0 1 0" rpy="1 1.5707963267948966 1"/>'
    shape = f'<visual>{place}<geometry><sphere radius="0.2"/></geometry></visual>'
    follow = '<mimic joint="shoulder" multiplier="2"/>'
    hand = link("hand", INERTIAL + shape)
    parts = (*TWO, loop, hand, joint("wrist", "lower", "hand", follow, "continuous"))
    model, _ = read(tmp_path, *parts)
    report = pg.write_urdf(model, tmp_path / "again.urdf")
    again, _ = pg.read_urdf(tmp_path / "again.urdf")
    assert equal(again.model_dump(), model.model_dump())
    assert report.loaded
    assert [c.kind for c in model.constraints] == ["gear", "revolute"]


def test_joints_of_several_motions_are_chains_with_the_same_motion(tmp_path):
    two = {"parent": "a", "link": (0, 1, 0), "rotation": (0.8, 0, 0.6, 0), "mass": 2.0}
    bodies = [
        pg.Body(name="a", joint="free", mass=1.0, inertia=np.eye(3)),
        pg.Body(name="b", joint="universal", **two),
        pg.Body(name="c", joint="cylindrical", **{**two, "parent": "b", "com": (0.1, 0, 0)}),
    ]
    model = pg.Model(bodies=bodies)
    pg.write_urdf(model, tmp_path / "chain.urdf")
    again, _ = pg.read_urdf(tmp_path / "chain.urdf")
    rng = np.random.default_rng(0)
    mech, other = pg.Mechanism(model), pg.Mechanism(again)
    q, v = mech.home()[0], rng.normal(size=mech.nv)
    q[7:] = rng.normal(size=4)
    assert (mech.nq, mech.nv) == (other.nq, other.nv)
    np.testing.assert_allclose(other.mass_matrix(q), mech.mass_matrix(q), atol=1e-13)
    np.testing.assert_allclose(other.bias_force(q, v), mech.bias_force(q, v), atol=1e-12)


def test_parts_that_urdf_does_not_have_are_left_out_or_refused(tmp_path):
    capsule = {"kind": "capsule", "radius": 0.1, "length": 1}
    capsule |= {"surface_velocity": (1, 0, 0), "surface_spin": (0, 0, 2)}
    controls = [pg.Filter(name="slow", input="=v.a", lag=1.0), pg.State(name="sum", rate="=q.a")]
    arm = pg.Model(
        bodies=[pg.Body(name="a", stiffness=3.0, shape=capsule)],
        controls=controls,
        contacts=[pg.Contact(name="floor", body="a")],
        forces=[pg.Wrench(name="push", body="a", force=(1, 0, 0))],
        gravity=(0, 0, -1.6),
    )  # fmt: skip
    report = pg.write_urdf(arm, tmp_path / "a.urdf")
    assert not report.loaded
    told = "\n".join(str(e) for e in report.of("left out"))
    parts = ["body 'a'", "stiffness", "force 'push'", "contact 'floor'", "gravity"]
    parts += ["surface_velocity", "surface_spin", "control 'slow'", "control 'sum'"]
    for part in parts:
        assert part in told
    assert [s.kind for s in pg.load(tmp_path / "a.urdf").bodies[0].shapes] == [
        "cylinder", "sphere", "sphere",
    ]  # fmt: skip
    ball = pg.Model(bodies=[pg.Body(name="b", joint="spherical")])
    with pytest.raises(pg.ModelError, match="body 'b', joint"):
        pg.write_urdf(ball, tmp_path / "b.urdf")
    assert not (tmp_path / "b.urdf").exists()
    with pytest.raises(pg.FileError, match="write_urdf"):
        arm.save(tmp_path / "c.urdf")


def worlds(folder: Path) -> dict[str, list[pg.Body]]:
    """Bodies whose names a writer would give to links or bodies that it adds."""
    mesh = folder / "rock.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    box = {"kind": "box", "size": (2, 2, 0.2), "position": (0, 0, -0.5)}
    floor = [box, {"kind": "sphere", "radius": 0.1}, {"kind": "mesh", "file": str(mesh)}]
    still = {"joint": "weld", "mass": 0.0, "com": (0, 0, 0), "inertia": np.zeros((3, 3))}
    solid = {"mass": 2.0, "com": (0.1, 0, 0.2), "inertia": np.diag((0.3, 0.4, 0.5))}
    free = pg.Body(name="b", joint="free", shape={"kind": "sphere", "radius": 0.1}, **solid)
    on_it = pg.Body(name="c", parent="world", link=(1, 0, 0), **solid)
    two = pg.Body(name="a", joint="universal", **solid)
    return {
        "with a floor": [pg.Body(name="world", shapes=floor, **still), free],
        "with a floor elsewhere": [
            pg.Body(name="world", link=(3, 0, 1), rotation=(0.8, 0, 0.6, 0), shapes=floor, **still),
            on_it, free,
        ],
        "alone": [pg.Body(name="world", shapes=floor, **still), on_it],
        "empty": [pg.Body(name="world", **still), on_it],
        "that moves": [pg.Body(name="world", shapes=floor, axes=(0, 1, 0), **solid), on_it],
        "twice": [pg.Body(name="world", shapes=floor, **still), free,
                  pg.Body(name="world'", link=(0, 0, 1), **solid)],
        "no world": [two, pg.Body(name="a/1", parent="a", link=(0, 0, 1), **solid)],
    }  # fmt: skip


@pytest.mark.parametrize("suffix", ["urdf", "xml"])
@pytest.mark.parametrize(
    "case",
    ["with a floor", "with a floor elsewhere", "alone", "empty", "that moves", "twice", "no world"],
)
def test_names_that_a_writer_adds_are_free(case, suffix, tmp_path):
    """The file is read, and has the motion and the solids of the model."""
    if suffix == "xml":
        pytest.importorskip("mujoco")
    model = pg.Model(bodies=worlds(tmp_path)[case])
    path = tmp_path / f"a.{suffix}"
    report = (pg.write_urdf if suffix == "urdf" else pg.write_mjcf)(model, path)
    again = pg.load(path)
    mech, other = pg.Mechanism(model), pg.Mechanism(again)
    assert (mech.nq, mech.nv) == (other.nq, other.nv)
    rng = np.random.default_rng(0)
    q, v = mech.home()[0], rng.normal(size=mech.nv)
    np.testing.assert_allclose(other.mass_matrix(q), mech.mass_matrix(q), atol=1e-13)
    np.testing.assert_allclose(other.bias_force(q, v), mech.bias_force(q, v), atol=1e-12)
    places = list[set[tuple[str, float, float, float]]]()
    for each in (model, again):
        place, turn = pg.Mechanism(each).packed.home_poses
        rows = ((k, shape) for k, body in enumerate(each.bodies) for shape in body.shapes)
        found = ((x.kind, *np.round(place[k] + turn[k] @ x.position, 9)) for k, x in rows)
        places.append(set(found))
    assert places[0] == places[1]
    renamed = "world" in model.row and "world" not in again.row and suffix == "urdf"
    assert renamed == ("is the link" in str(report))


def test_point_masses_and_joints_of_one_name_are_written(tmp_path):
    bodies = [pg.Body(name="a", mass=1.0), pg.Body(name="b", parent="a", mass=2.0)]
    bodies[1] = bodies[1].model_copy(update={"inertia": np.zeros((3, 3))})
    model = pg.Model(bodies=bodies, forces=[pg.Motor(name="a joint", body="b")])
    pg.write_urdf(model, tmp_path / "a.urdf")
    again, _ = pg.read_urdf(tmp_path / "a.urdf")
    assert [(b.mass, b.joint) for b in again.bodies] == [(1.0, "revolute"), (2.0, "revolute")]


def test_commands_report_the_losses_and_warnings_of_an_import(capsys, tmp_path):
    """Units that look wrong: millimetres, grams and degrees."""
    origin = '<origin xyz="0 0 500" rpy="90 0 0"/>'
    heavy = INERTIAL.replace('mass value="2"', 'mass value="2e6"')
    mesh = '<collision><geometry><mesh filename="/etc/passwd"/></geometry></collision>'
    path = tmp_path / "far.urdf"
    path.write_text(
        robot(
            link("a", heavy),
            link("b", INERTIAL + mesh),
            joint("j", "a", "b", origin + '<mimic joint="zz"/>', kind="continuous"),
        )
    )
    model, report = pg.read_urdf(path)
    entries = [str(entry) for kind in ("warning", "left out") for entry in report.of(kind)]
    for fact in ("'zz'", "/etc/passwd", "degrees", "millimetres", "grams", "500 m"):
        assert any(fact in entry for entry in entries), fact
    assert main(["check", str(path)]) == 0
    out = capsys.readouterr().out
    assert all(entry in out for entry in entries)
    assert main(["convert", str(path), str(tmp_path / "arm.json")]) == 0
    assert "'zz'" in capsys.readouterr().out
    assert pg.Model.load(tmp_path / "arm.json").bodies == model.bodies
    again = pg.load(path)
    assert any("'zz'" in notice for notice in again.notices)
    assert f"{len(again.notices)} notices" in str(again)
    assert again.notices[0] in str(again)
    assert "notice" not in str(pg.Model(bodies=again.bodies))
    assert main(["convert", str(path), str(tmp_path / "arm.step")]) == 1
    assert ".urdf" in capsys.readouterr().err


def test_every_fault_of_a_file_is_named(tmp_path):
    """Names, ends, types, axes, numbers: ten faults, each with its line, at once."""
    path = tmp_path / "faults.urdf"
    path.write_text(
        robot(
            link("a", INERTIAL.replace('"2"', '"heavy"')),
            link("b", INERTIAL.replace('"2"', '"-2"')),
            link("b"),
            joint("j", "a", "zz", '<origin xyz="1 2"/>', kind="revolut"),
            joint("j", "a", "b", '<axis xyz="0 0 0"/><dynamics damping="-1" friction="x"/>'),
        )
    )
    with pytest.raises(pg.FileError) as refused:
        pg.read_urdf(path)
    faults = sorted((p.where.split(", ")[1], p.field) for p in refused.value.problems)
    assert sorted(field for _, field in faults) == [
        "axis", "child", "damping", "friction", "mass", "name", "name", "type", "value",
        "xyz",
    ]  # fmt: skip
    assert all(line.startswith("line ") for line, _ in faults)

"""Contacts of MJCF files, read and written, beside MuJoCo."""

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from tests.pairs import touching

from .mjcf_files import BALL, BALLED, BALLS, NO_MASKS, compiled, forward, mujoco, read, written


def test_each_pair_keeps_its_friction(tmp_path):
    bodies = [pg.Body(name=x, joint="free", link=(k, 0, 1), **BALLED) for k, x in enumerate("abc")]
    bodies.append(pg.Body(name="d", parent="a", **BALLED))
    contacts = [
        pg.Contact(name=body + other, body=body, other=other, **laws)
        for body, other, laws in (
            ("a", "ground", {"friction": 0.9}),
            ("b", "ground", {"friction": 0.1, "rolling_friction": 0.01}),
            ("a", "b", {"friction": 0.0}),
            ("b", "c", {"friction": 0.5, "spinning_friction": 0.02}),
            ("a", "d", {"friction": 0.3}),  # neighbours
        )
    ]
    again, _ = written(tmp_path, pg.Model(up="z", bodies=bodies, contacts=contacts))
    kinds = ("friction", "spinning_friction", "rolling_friction")
    before, after = (
        {frozenset(c.pair): [getattr(c, k) or 0.0 for k in kinds] for c in parts}
        for parts in (contacts, again.contacts)
    )
    assert after == before


HEAP = """<mujoco><option><flag {}/></option><worldbody>
<geom name="floor" type="plane" size="1 1 1"/><geom type="plane" size="1 1 1" zaxis="-1 0 1"/>
<geom size=".5"/><body name="a"><freejoint/><geom type="box" size=".2 .1 .1" contype="2"/></body>
<body name="b"><freejoint/><geom type="ellipsoid" size=".1 .2 .3" conaffinity="2"/></body>
<body name="c"><freejoint/><geom name="c" type="cylinder" size=".1 .2" {}/>
<body name="d"><joint axis="1 0 0"/><geom type="box" size=".1 .2 .3"/>
<body name="e"><joint axis="0 1 0"/><geom name="e" type="capsule" size=".1 .2"/></body></body>
</body></worldbody><contact><pair geom1="c" geom2="floor"/><pair geom1="c" geom2="e"/>
<exclude body1="a" body2="b"/></contact></mujoco>"""


@pytest.mark.parametrize("margin", [0.0, 0.02])
@pytest.mark.parametrize("gap", [0.0, 0.01, 0.02])
@pytest.mark.parametrize("pair", [True, False])
def test_margins_in_which_mujoco_pushes_are_reported(tmp_path, margin, gap, pair):
    """It pushes before bodies touch, here by 0.01 m."""
    wide = f'margin="{margin}" gap="{gap}"'
    text = BALL.format(f'<geom name="g" size="0.1" {"" if pair else wide}/>')
    text = text.replace('pos="0 0 1"', 'pos="0 0 0.105"')
    if pair:
        text += f'</worldbody><contact><pair geom1="g" geom2="floor" {wide}/></contact><worldbody>'
    _, report = read(tmp_path, f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    _, data = forward(tmp_path)
    pushes = any(c.includemargin > 0.0 for c in data.contact)
    assert any("margin" in e.text for e in report.of("approximated")) == pushes, str(report)


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("smooth", ["", '<geom type="plane" size="1 1 1" condim="1"/>'])
def test_the_cone_of_friction_is_round(tmp_path, cone, smooth):
    """Also where other pairs have no friction."""
    text = BALLS.format("").replace("<mujoco>", f'<mujoco><option cone="{cone}"/>')
    text = text.replace("<worldbody>", f"<worldbody>{smooth}")
    _, report = read(tmp_path, text)
    assert ("pyramid" in str(report)) == (cone == "pyramidal")


@pytest.mark.parametrize("flag", ["filterparent", "contact", "constraint", "warmstart"])
def test_the_bodies_that_may_touch_are_those_of_mujoco(tmp_path, flag):
    """All overlap, so that MuJoCo finds every pair that its rules leave."""
    model, _ = read(tmp_path, HEAP.format(f'{flag}="disable"', NO_MASKS))
    m, data = forward(tmp_path)
    name = lambda g: m.body(m.geom_bodyid[g]).name if g else "ground"  # noqa: E731
    found = {frozenset(map(name, pair)) for pair in data.contact.geom.tolist()}
    assert touching(model) == found


GEOMS = {
    "sphere": 'size=".1"', "box": 'size=".1 .2 .3"', "capsule": 'size=".1 .2"',
    "cylinder": 'size=".1 .2"', "ellipsoid": 'size=".1 .2 .3"',
    "mesh": 'mesh="part" pos=".1 .2 .3" euler="10 20 30"',
}  # fmt: skip


@pytest.mark.parametrize("kind", GEOMS)
def test_shapes_are_as_far_from_others_as_in_mujoco(tmp_path, kind):
    part = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    part.apply_translation((0.1, 0.2, 0.3))
    part.export(tmp_path / "part.stl")
    text = f"""<mujoco><asset><mesh name="part" file="part.stl" scale="1 2 1"/></asset><worldbody>
    <geom type="plane" size="1 1 1"/><geom type="plane" size="1 1 1" pos="4 0 0" zaxis="-1 0 1"/>
    <geom pos="1 3 2" size=".5"/><body name="a" pos="1 1 2" euler="30 50 70"><freejoint/>
    <geom type="{kind}" {GEOMS[kind]}/></body></worldbody></mujoco>"""
    model, _ = read(tmp_path, text)
    m, data = compiled(tmp_path)
    m.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)  # libccd is wrong by mm
    mujoco.mj_kinematics(m, data)
    floor, wall, ball = (mujoco.mj_geomDistance(m, data, g, 3, 1e3, None) for g in range(3))
    gaps = pg.simulate(model, t_end=1e-3).contact_gap
    others = {c.other if "a" in (c.body, "*") else c.body: c.name for c in model.contacts}
    found = sorted(float(gaps[name][0]) for name in others.values())
    np.testing.assert_allclose(found, sorted((floor, min(wall, ball))), atol=1e-6)


def test_pairs_name_geoms_that_are_written(tmp_path):
    """MuJoCo has no cone, so the pair of a joint's bodies is that of their other shapes."""
    cone = pg.Shape(kind="cylinder", radius=0.1, length=0.3, end_radius=0.05)
    ball = pg.Shape(kind="sphere", radius=0.1)
    solid = {"mass": 1.0, "inertia": np.eye(3)}
    one = pg.Body(name="a", joint="free", shapes=(cone, ball), **solid)
    two = pg.Body(name="b", parent="a", shapes=(ball,), **solid)
    touch = pg.Contact(name="both", body="a", other="b", friction=0.3)
    pg.write_mjcf(pg.Model(bodies=[one, two], contacts=[touch]), tmp_path / "a.xml")
    (contact,) = pg.load(tmp_path / "a.xml").contacts
    assert {contact.body, contact.other} == {"a", "b"}


def test_rolling_and_spinning_friction_of_the_ground_are_those_of_its_contacts(tmp_path):
    ball = pg.Body(
        name="b",
        joint="free",
        link=(0, 0, 1),
        inertia=np.eye(3),
        shape={"kind": "sphere", "radius": 0.1},
    )
    other = ball.model_copy(update={"name": "o"})
    contacts = [
        pg.Contact(name="as the ground", body="b"),
        pg.Contact(name="own", body="o", rolling_friction=0.0, spinning_friction=0.07),
    ]
    ground = pg.Ground(friction=0.3, rolling_friction=0.02, spinning_friction=0.03)
    model = pg.Model(bodies=[ball, other], contacts=contacts, ground=ground)
    again, _ = written(tmp_path, model)
    found = {
        c.body: tuple(c.frictions(again.ground))
        for c in again.contacts
        if c.active and c.other == "ground"
    }
    expected = {c.body: tuple(c.frictions(ground)) for c in contacts}
    assert found == expected

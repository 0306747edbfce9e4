"""Contacts of files that others wrote, beside MuJoCo."""

import itertools

import numpy as np
import pytest

import pgraph_core as pg
from tests.nights import combined
from tests.pairs import touching

from .test_files_of_strangers import written

STATIC = {
    "plane": '<geom type="plane" size="1 1 .1"/>',
    "table": '<geom type="box" size="1 1 .1"/>',
    "shelf": '<body name="s" pos="0 0 .5"><geom type="box" size="1 1 .1"/></body>',
    "wall": '<geom type="plane" size="1 1 .1" euler="0 30 0"/>',
}


@pytest.mark.parametrize(
    ("static", "count", "own", "child"),
    combined(
        STATIC, [1, 2], ["", 'friction=".3"'],
        ["", '<geom size=".2"/>', '<joint/><geom size=".2" pos="0 0 .3"/>'],
    ),
)  # fmt: skip
def test_mocap_bodies_touch_what_moves_only(tmp_path, static, count, own, child):
    mujoco = pytest.importorskip("mujoco")
    child = f'<body name="k">{child}</body>' if child else ""
    inside = [f'<geom size=".1" {own}/>{child}', f'<geom size=".1" {own}/>']
    mocap = "".join(
        f'<body name="m{k}" pos="{3 * k} 0 1" mocap="true">{inside[k]}</body>' for k in range(count)
    )
    ball = '<body name="a" pos="0 0 1.19"><freejoint/><geom size=".1" friction=".4"/></body>'
    path = written(
        tmp_path, f"<mujoco><worldbody>{STATIC[static]}{mocap}{ball}</worldbody></mujoco>", "m.xml"
    )
    model = pg.load(path)
    run = pg.simulate(model, t_end=0.01)
    assert run.success
    m = mujoco.MjModel.from_xml_path(str(path))
    assert touching(model) == mujocos(mujoco, m)


def mujocos(mujoco, m):
    """Return the pairs of bodies that MuJoCo lets touch, of which one moves."""
    still = [0 if m.body_mocapid[w] >= 0 else int(w) for w in m.body_weldid]
    above = [int(m.body_weldid[p]) for p in m.body_parentid]
    out = {frozenset((int(s) >> 16, int(s) & 0xFFFF)) for s in m.exclude_signature}
    found = set()
    for g, h in itertools.combinations(range(m.ngeom), 2):
        a, b = int(m.geom_bodyid[g]), int(m.geom_bodyid[h])
        p, q = int(m.body_weldid[a]), int(m.body_weldid[b])
        related = (p and p == above[q]) or (q and q == above[p])
        able = (
            m.geom_contype[g] & m.geom_conaffinity[h] or m.geom_contype[h] & m.geom_conaffinity[g]
        )
        if still[a] != still[b] and able and not related and frozenset((a, b)) not in out:
            flat = [m.geom_type[x] == 0 and not m.geom_quat[x][1:].any() for x in (g, h)]
            ends = [m.body(x).name if x else "world" for x in (a, b)]
            found.add(frozenset("ground" if f else end for f, end in zip(flat, ends)))
    return found


def legs(n, rules, friction=".7"):
    own = [f'friction="{friction}"', *[""] * (n - 1)]
    bodies = "".join(
        f"""<body name="a{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/>
        <body name="b{i}" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".1"/>
        <body name="c{i}" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".1" {own[i]}/></body>
        </body></body>"""
        for i in range(n)
    )
    return f"""<mujoco><worldbody><geom type="plane" size="9 9 1"/>{bodies}</worldbody>
      <contact>{rules}</contact></mujoco>"""


@pytest.mark.parametrize(
    ("rule", "n", "friction"),
    combined(["none", "one", "each", "across", "world"], [2, 5, 12], ["1", "1.5"]),
)
def test_contacts_are_as_many_as_the_exceptions_to_one_law(tmp_path, n, friction, rule):
    """The law of '*' holds for all pairs but those that a file excludes or gives other friction."""
    mujoco = pytest.importorskip("mujoco")
    out = {
        "none": [], "one": [("a0", "c0")], "each": [(f"a{i}", f"c{i}") for i in range(n)],
        "across": [("a0", "b1"), ("c1", "c0")], "world": [("world", "a1")],
    }[rule]  # fmt: skip
    rules = "".join(f'<exclude body1="{a}" body2="{b}"/>' for a, b in out)
    path = written(tmp_path, legs(n, rules, friction), "m.xml")
    model = pg.load(path)
    assert touching(model) == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))
    odd = 0 if friction == "1" else 3 * n  # the pairs of one body, and the floor
    assert len(model.contacts) <= 2 + len(out) + odd
    frictions = {c.friction for c in model.contacts if c.active}
    assert frictions == {1.0, float(friction)}
    pg.write_mjcf(model, tmp_path / "again.xml")
    assert touching(pg.load(tmp_path / "again.xml")) == touching(model)


@pytest.mark.parametrize("count", [3, 25])
@pytest.mark.parametrize("first", ["named", "every"])
@pytest.mark.parametrize("active", [True, False])
def test_a_contact_of_two_bodies_takes_the_place_of_that_of_all(count, first, active):
    ball = {"kind": "sphere", "radius": 0.1}
    bodies = [
        pg.Body(f"b{k}", joint="free", q=(0.5 * k, 0, 0, 1, 0, 0, 0), shape=ball)
        for k in range(count)
    ]
    own = pg.Contact("own", body="b1", other="b0", friction=0.1, active=active)
    every = pg.Contact("every", body="*", other="*", friction=0.5)
    contacts = [own, every] if first == "named" else [every, own]
    start = {"b0": (1.0, 0, 0), "b2": (-1.0, 0, 0)}
    bodies = [b.model_copy(update={"v": (0, 0, 0, *start.get(b.name, (0, 0, 0)))}) for b in bodies]
    model = pg.Model(bodies, contacts=contacts, gravity=(0, 0, 0))
    assert (frozenset(("b0", "b1")) in touching(model)) == active
    assert frozenset(("b1", "b2")) in touching(model)
    run = pg.simulate(model, t_end=0.5, step=1e-2)
    assert (run["b0"][-1, 0] > 0.4) != active  # it passes through b1, or stops there
    assert not any("both push" in text for text in model.doubts)


WAYS = [("translate", axis) for axis in np.eye(3).tolist()]


JOINTS = {
    "free": {"joint": "free"},
    "six": {"joint": "compound", "motions": [*WAYS, ("ball", (0, 0, 1))]},
    "five": {"joint": "compound", "motions": [*WAYS[:2], ("ball", (0, 0, 1))]},
    "ball": {"joint": "spherical"},
    "weld": {"joint": "weld"},
}


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("carrier", ["weld", "prismatic"])
@pytest.mark.parametrize("others", [0, 25])
def test_all_bodies_touch_but_those_that_a_joint_restrains(tmp_path, joint, carrier, others):
    """A joint with six degrees of freedom restrains nothing."""
    box, ball = {"kind": "box", "size": (1, 1, 1)}, {"kind": "sphere", "radius": 0.1}
    bodies = [
        pg.Body("table", joint=carrier, shape=box, density=100.0),
        pg.Body("b", "table", link=(0, 0, 0.8), shape=ball, density=100.0, **JOINTS[joint]),
    ]
    bodies += [
        pg.Body(f"o{k}", joint="free", q=(2 + k, 0, 0, 1, 0, 0, 0), shape=ball, density=100.0)
        for k in range(others)
    ]
    model = pg.Model(bodies, contacts=[pg.Contact("all", body="*", other="*")])
    meet = joint in ("free", "six")
    assert (frozenset(("table", "b")) in touching(model)) == meet
    if meet and not others and carrier == "weld":
        run = pg.simulate(model, t_end=0.4, step=1e-3, estimate=False)
        assert run.position("b")[-1][2] == pytest.approx(0.6, abs=1e-6)
    if joint != "free":  # which MuJoCo has on the ground only
        pytest.importorskip("mujoco")
        pg.write_mjcf(model, tmp_path / "out.xml")
        assert touching(pg.load(tmp_path / "out.xml")) == touching(model)


@pytest.mark.parametrize("slides", [2, 3])
@pytest.mark.parametrize("carrier", ["", "<freejoint/>"])
def test_neighbours_with_every_freedom_touch_as_in_mujoco(tmp_path, slides, carrier):
    mujoco = pytest.importorskip("mujoco")
    ways = "".join(f'<joint type="slide" axis="{x}"/>' for x in ("1 0 0", "0 1 0", "0 0 1"))
    ways = ways[: slides * len(ways) // 3] + '<joint type="ball"/>'
    child = f'<body name="b" pos="0 0 1">{ways}<geom size=".1"/></body>'
    text = f'<body name="a">{carrier}<geom size=".2"/>{child}</body>'
    path = written(tmp_path, f"<mujoco><worldbody>{text}</worldbody></mujoco>", "m.xml")
    found = touching(pg.load(path))
    assert found == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))


def test_bodies_that_are_fixed_to_the_ground_do_not_touch_it():
    box = {"kind": "box", "size": (1, 1, 1)}
    bodies = [pg.Body("table", joint="weld", shape=box), pg.Body("b", joint="free", shape=box)]
    model = pg.Model(bodies, contacts=[pg.Contact("floor", body="*")])
    assert touching(model) == {frozenset(("b", "ground"))}


@pytest.mark.parametrize("joint", ["", '<joint axis="1 0 0"/>'])
def test_bodies_that_are_fixed_to_a_child_do_not_touch_its_parent(tmp_path, joint):
    """MuJoCo leaves out a body and all that is fixed to its child."""
    mujoco = pytest.importorskip("mujoco")
    ball = '<geom size=".1" mass="1"/>'
    text = f"""<mujoco><worldbody><body name="a"><freejoint/>{ball}<body name="b" pos=".1 0 0">
      <joint axis="0 1 0"/>{ball}<body name="c" pos=".1 0 0">{joint}{ball}</body></body></body>
      <body name="d" pos="0 0 1"><freejoint/>{ball}</body></worldbody></mujoco>"""
    path = written(tmp_path, text, "m.xml")
    model = pg.load(path)
    assert touching(model) == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))
    assert (frozenset("ac") in touching(model)) == bool(joint)

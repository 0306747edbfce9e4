"""Springs with limits of their length (strings), in runs and compared with MuJoCo."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

pytestmark = pytest.mark.quick


def swinging(force: pg.Force | None = None, rod: pg.Constraint | None = None, v: float = 3.0):
    """A point of 1 kg in the x-z plane, 1 m below the origin, that moves along x."""
    point = pg.Body(
        name="ball", joint="compound", motions=[("translate", (1, 0, 0)), ("translate", (0, 0, 1))],
        mass=1.0, inertia=((0.0,) * 3,) * 3, q=(0.0, -1.0), v=(v, 0.0),
    )  # fmt: skip
    return pg.Model(
        up="z", gravity=(0, 0, -9.81), bodies=[point], forces=[force] if force else [],
        constraints=[rod] if rod else [],
    )  # fmt: skip


HERE: dict[str, Any] = {"name": "string", "body": "ball", "point": (0, 0, 0)}


@pytest.mark.parametrize("ends", [{"high": 1.0}, {"low": 1.0, "high": 1.0}])
def test_a_ball_swings_on_a_string_as_on_a_rod(ends: dict[str, Any]):
    rod = pg.Distance(name="rod", body="ball", point=(0, 0, 0), other_point=(0, 0, 0), length=1.0)
    exact = pg.simulate(swinging(rod=rod), t_end=2.0, method="dop853", rtol=1e-10)
    errors = []
    for step in (4e-3, 2e-3):
        run = pg.simulate(swinging(pg.Spring(**HERE, **ends)), t_end=2.0, step=step, estimate=False)
        assert run.status.ok
        assert np.abs(np.linalg.norm(run.q, axis=1) - 1.0).max() < 20.0 * step**2
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
    assert errors[1] < 2e-4
    assert errors[0] > 3.0 * errors[1]  # of second order
    pull = run.contacts.limit["spring string high limit"]
    assert (pull <= 0.0).all()
    lowest = 1 + np.argmin(run.q[1:, 1])  # the weight and the centripetal force
    speed = np.linalg.norm(run.v[lowest])
    assert pull[lowest] == pytest.approx(-9.81 - speed**2, rel=0.02)


def test_a_string_is_slack_until_it_is_taut():
    """A ball that is thrown sideways flies free, then loses its speed along the string."""
    model = swinging(pg.Spring(**HERE, high=2.0), v=1.5)
    run = pg.simulate(model, t_end=1.0, step=1e-3, estimate=False, frames=1001)
    length = np.linalg.norm(run.q, axis=1)
    free = run.t < 0.4
    np.testing.assert_allclose(run.q[free, 0], 1.5 * run.t[free], atol=1e-9)
    assert length.max() < 2.0 + 5e-3  # of one step at 5 m/s
    taut = int(np.argmax(length > 2.0 - 1e-3)) + 5
    along = np.einsum("ij,ij->i", run.q, run.v) / length
    assert np.abs(along[taut:]).max() < 0.1
    assert np.ptp(run.energy[free]) < 1e-12
    assert run.energy[-1] < run.energy[0] - 0.5  # J: what was along the string


def test_two_bodies_share_the_pull_of_a_string():
    """One pulls the other along: momentum is kept, and their speeds along the string are equal."""
    bodies = [
        pg.Body(
            name=n,
            joint="free",
            mass=m,
            inertia=(0.01,) * 3,
            q=(x, 0, 0, 1, 0, 0, 0),
            v=(0, 0, 0, v, 0, 0),
        )
        for n, m, x, v in (("a", 1.0, 0.0, 0.0), ("b", 3.0, 0.5, 2.0))
    ]
    string = pg.Spring(name="s", body="a", other="b", point=(0, 0, 0), high=1.0)
    model = pg.Model(bodies=bodies, forces=[string], gravity=(0, 0, 0))
    run = pg.simulate(model, t_end=0.5, step=1e-3, estimate=False)
    np.testing.assert_allclose(run.v[-1, [3, 9]], 1.5, rtol=1e-9)
    assert run.q[-1, 7] - run.q[-1, 0] == pytest.approx(1.0, abs=1e-4)
    strut = model.replace(
        forces=[pg.Spring(name="s", body="a", other="b", point=(0, 0, 0), low=0.3)]
    )
    strut = strut.edit("b", v=(0, 0, 0, -2.0, 0, 0))
    run = pg.simulate(strut, t_end=0.5, step=1e-3, estimate=False)
    np.testing.assert_allclose(run.v[-1, [3, 9]], -1.5, rtol=1e-9)
    assert run.q[-1, 7] - run.q[-1, 0] == pytest.approx(0.3, abs=1e-4)


def test_strings_that_do_not_fit_are_refused_or_reported():
    with pytest.raises(pg.ModelError, match=r"low.*high"):
        pg.Spring(**HERE, low=2.0, high=1.0)
    with pytest.raises(pg.ModelError, match="high"):
        pg.Spring(**HERE, high=0.0)
    string = pg.Spring(**HERE, high=1.0)
    with pytest.raises(pg.InputError, match="moreau_jean"):
        pg.simulate(swinging(string), method="dop853", t_end=0.1)
    with pytest.raises(pg.InputError, match="spring"):
        pg.simulate(swinging(), forces=[string], t_end=0.1)
    pulled = swinging(string).replace(
        constraints=[pg.Motion(name="drive", body="ball", coordinate=1,
                               q_of_t={"kind": "polynomial", "coefficients": [-1, -1]})],
    )  # fmt: skip
    run = pg.simulate(pulled, v=(0.0, -1.0), t_end=0.2, step=1e-3, estimate=False)
    assert run.status is pg.Status.CANNOT_CLOSE
    assert "'spring string high limit'" in run.message
    assert "'drive'" in run.message


STRING = """<mujoco><worldbody><site name="nail" pos="0 0 .5"/>
<body name="a" pos="0 0 .2"><joint name="x" type="slide" axis="1 0 0"/>
<joint name="z" type="slide" axis="0 0 1"/><geom size=".1" mass="1"/><site name="s" pos=".1 0 0"/></body>
<body name="b" pos="1 0 0"><freejoint/><geom size=".1" mass="2"/><site name="t" pos="0 .1 0"/></body>
</worldbody><tendon>
<spatial name="string" limited="true" range="0 .7" margin="{margin}"><site site="nail"/><site site="s"/></spatial>
<spatial name="spring" limited="true" range=".9 3" stiffness="2" damping=".3"><site site="s"/>
<site site="t"/></spatial></tendon></mujoco>"""  # fmt: skip  # noqa: E501


def read(tmp_path: Path, text: str) -> tuple[pg.Model, Any]:
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return pg.read_mjcf(path)


def test_limits_of_tendons_between_sites_are_read_and_written(tmp_path: Path):
    mujoco: Any = pytest.importorskip("mujoco")
    from tests.core.test_mjcf_of_others import errors_of  # it needs mujoco too

    model, report = read(tmp_path, STRING.format(margin=0))
    assert report.loaded, report
    string, spring = (f for f in model.forces if isinstance(f, pg.Spring))
    assert (string.low, string.high, string.stiffness, string.other) == (None, 0.7, 0.0, "ground")
    assert (spring.low, spring.high) == (0.9, 3.0)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert pg.write_mjcf(model, tmp_path / "again.xml").loaded
    theirs = mujoco.MjModel.from_xml_path(str(tmp_path / "again.xml"))
    again, _ = pg.read_mjcf(tmp_path / "again.xml")
    assert [(f.low, f.high) for f in again.forces] == [(f.low, f.high) for f in model.forces]
    rng = np.random.default_rng(3)
    assert max(errors_of(again, m, rng).values()) < 1e-12
    assert max(errors_of(model, theirs, rng).values()) < 1e-12
    narrow, report = read(tmp_path, STRING.format(margin=".05"))
    assert (narrow.forces[0].low, narrow.forces[0].high) == pytest.approx(
        (0.05, 0.65)
    )  # where MuJoCo's rest
    assert any("margin" in str(e) for e in report.of("converted"))


OVER_SITES = STRING.partition("<tendon>")[0] + """<tendon>
<spatial name="rope" stiffness="20" damping=".3" springlength=".4"><site site="nail"/><site site="s"/>
<site site="t"/></spatial>
<spatial name="back" stiffness="30"><site site="t"/><site site="nail"/><site site="s"/></spatial>
<spatial name="limited" stiffness="2" limited="true" range="0 9"><site site="t"/><site site="nail"/>
<site site="s"/></spatial>
</tendon></mujoco>"""  # fmt: skip  # noqa: E501


def test_tendons_over_several_sites_are_read_and_written(tmp_path: Path):
    mujoco: Any = pytest.importorskip("mujoco")
    from tests.core.test_mjcf_of_others import errors_of  # it needs mujoco too

    model, report = read(tmp_path, OVER_SITES)
    rope, back, limited = (f for f in model.forces if isinstance(f, pg.Spring))
    assert (rope.body, [x.body for x in rope.via], rope.other) == ("b", ["a"], "ground")
    assert (back.body, [x.body for x in back.via], back.other) == ("b", ["ground"], "a")
    assert (rope.stiffness, rope.damping, rope.rest) == (20.0, 0.3, 0.4)
    assert limited.high is None
    assert any("limited" in str(e) for e in report.of("left out"))
    assert pg.write_mjcf(model, tmp_path / "again.xml").loaded
    again, _ = pg.read_mjcf(tmp_path / "again.xml")
    assert [f.via for f in again.forces] == [f.via for f in model.forces]
    rng = np.random.default_rng(3)
    for name in ("arm.xml", "again.xml"):
        m = mujoco.MjModel.from_xml_path(str(tmp_path / name))
        assert max(errors_of(model, m, rng).values()) < 1e-12


def test_a_ball_on_a_string_rests_as_in_mujoco(tmp_path: Path):
    """MuJoCo's soft limit gives way by about g timeconst², twice that is the tolerance."""
    mujoco: Any = pytest.importorskip("mujoco")
    text = STRING.format(margin=0).replace(
        'limited="true" range="0 .7"',
        'limited="true" range="0 .7" solreflimit=".004 1" solimplimit=".9999 .9999 1"',
    )
    model, _ = read(tmp_path, text.replace('stiffness="2" damping=".3"', ""))
    model = model.replace(forces=[model["string"]], gravity=(0, 0, -9.81))
    m = mujoco.MjModel.from_xml_string(text.replace('stiffness="2" damping=".3"', ""))
    m.tendon_limited[1], m.dof_damping[:2] = 0, 2.0
    data = mujoco.MjData(m)
    for _ in range(4000):
        mujoco.mj_step(m, data)
    damped = model.edit("a", damping=(2.0, 2.0))
    run = pg.simulate(damped, t_end=8.0, step=2e-3, estimate=False)
    assert run.status.ok
    assert run.q[-1, :2] == pytest.approx(data.qpos[:2], abs=2.0 * 9.81 * 0.004**2)

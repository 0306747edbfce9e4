"""Files for tests of MJCF: read, written, and compiled by MuJoCo."""

import numpy as np
import pytest

import pgraph_core as pg

mujoco = pytest.importorskip("mujoco")

from tests.core.test_mjcf_of_others import errors_of  # noqa: E402 (it needs mujoco too)

ARM = """<mujoco model="arm">
<compiler angle="degree"/><option gravity="0 0 -1.6"/>
<default><geom friction="0.7 0.01 0.001"/><joint damping="0.3"/></default>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/><camera name="eye"/>
  <body name="trunk" pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" rgba="1 0 0 1"/>
    <site name="tip" pos="0 0 .3"/>
    <body name="upper" pos="0 0 -.3" euler="0 0 30">
      <joint name="shoulder" type="hinge" axis="0 1 0" pos="0 0 .1" range="-30 60" armature=".2"
             stiffness="4" springref="15" frictionloss=".1"/>
      <geom type="capsule" size=".05 .2" mass="2"/>
      <body name="lower" pos="0 0 -.4">
        <joint name="a" axis="1 0 0"/><joint name="b" type="slide" axis="0 0 1"/>
        <geom type="cylinder" size=".05 .1" contype="0" conaffinity="0"/>
        <geom type="sphere" size=".06" pos="0 0 -.2" group="3"/>
      </body>
    </body>
    <body name="tail" pos="0 -.3 0"><joint name="t" axis="1 0 0"/><geom size=".1"/></body>
  </body>
</worldbody>
<contact><exclude body1="lower" body2="tail"/></contact>
<equality><joint joint1="t" joint2="shoulder" polycoef="0.1 2 0 0 0"/></equality>
<actuator><motor name="m" joint="a" gear="3" ctrlrange="-2 2"/>
  <position name="p" joint="shoulder" kp="50" kv="2" forcerange="-9 9"/></actuator>
<keyframe><key name="bent" qpos="0 0 2 1 0 0 0 .5 .1 .2 .3"/></keyframe>
</mujoco>
"""  # fmt: skip

DYNAMIC = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
<geom size=".1" mass="2"/></body></worldbody><actuator><general name="m" joint="x"
gainprm="3" ctrlrange="-9 9" {}/></actuator></mujoco>"""
INTEGRATED = DYNAMIC.format('dyntype="integrator" actrange="-.5 .6"')
BALLED = {"mass": 1, "inertia": np.eye(3), "shape": {"kind": "sphere", "radius": 0.1}}
NO_MASKS = 'contype="0" conaffinity="0"'
FOUR = 'contype="4" conaffinity="4"'
OTHER = '<geom type="box" size=".1 .1 .1" {}/>'
BALLS = """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/>{}</body>
<body name="b" pos=".15 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""
BALL = '<geom name="floor" type="plane" size="1 1 1"/><body pos="0 0 1"><freejoint/>{}</body>'


def read(tmp_path, text=ARM):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return pg.read_mjcf(path)


def loaded(tmp_path, text):
    """Return the model of a text, nothing of which is omitted."""
    model, report = read(tmp_path, text)
    assert report.loaded, report
    return model


def compiled(tmp_path, name="arm.xml"):
    m = mujoco.MjModel.from_xml_path(str(tmp_path / name))
    return m, mujoco.MjData(m)


def forward(tmp_path, name="arm.xml"):
    m, data = compiled(tmp_path, name)
    mujoco.mj_forward(m, data)
    return m, data


def written(tmp_path, model):
    """Return the model of a file written without omissions, and MuJoCo's model of it."""
    assert pg.write_mjcf(model, tmp_path / "out.xml").loaded
    return pg.read_mjcf(tmp_path / "out.xml")[0], compiled(tmp_path, "out.xml")[0]


def agree(model, m, ctrl=0.0) -> bool:
    rng = np.random.default_rng(0)
    return all(max(errors_of(model, m, rng, ctrl).values()) < 1e-12 for _ in range(2))


def texts(report, kind):
    return "\n".join(f"{entry.where}: {entry.text}" for entry in report.of(kind))

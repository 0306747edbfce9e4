"""MJCF as onshape-to-robot 1.8 writes it: loop closures between sites, two for a hinge."""

import numpy as np
import pytest

import pgraph_core as pg

pytest.importorskip("mujoco")
INERTIAL = '<inertial pos="{} 0 0" mass="0.1" fullinertia="1e-5 1e-4 1e-4 0 0 0" />'
SITES = """<site group="3" name="{0}" pos="0.1 0 0" quat="{1}" />
<site group="3" name="{0}_z" pos="0.1 0 0.1" quat="{1}" />"""


def four_bar(closure: str) -> str:
    """A square linkage of 0.1 m. The frames of its closure carry another 0.1 m along z."""
    return f"""<?xml version="1.0" ?>
<mujoco model="four_bar">
<compiler angle="radian" meshdir="assets" autolimits="true" />
<option noslip_iterations="1"></option>
<default><default class="four_bar"><joint frictionloss="0.1" armature="0.005"/>
<position kp="50" dampratio="1" /></default></default>
<worldbody>
<body name="base" pos="0 0 0" quat="1 0 0 0" childclass="four_bar">{INERTIAL.format(0.05)}
<body name="crank" pos="0 0 0" quat="0.707107 0 0 0.707107"><joint name="drive" type="hinge" />
{INERTIAL.format(0.05)}
<body name="coupler" pos="0.1 0 0" quat="0.707107 0 0 -0.707107"><joint name="pin" type="hinge" />
{INERTIAL.format(0.05)}{SITES.format("closing_loop_1", "0.707107 0 0 0.707107")}</body></body>
<body name="rocker" pos="0.1 0 0" quat="0.707107 0 0 0.707107"><joint name="far" type="hinge" />
{INERTIAL.format(0.05)}{SITES.format("closing_loop_2", "1 0 0 0")}</body></body>
</worldbody>
<actuator><position class="four_bar" name="drive" joint="drive" /></actuator>
<equality>{closure}</equality>
</mujoco>"""


HINGE = """<connect site1="closing_loop_1" site2="closing_loop_2" />
<connect site1="closing_loop_1_z" site2="closing_loop_2_z" />"""
BALL = '<connect site1="closing_loop_1" site2="closing_loop_2" />'
WELD = '<weld site1="closing_loop_1" site2="closing_loop_2" />'


@pytest.mark.parametrize(("closure", "rows", "dof"), [(HINGE, 6, 1), (BALL, 3, 1), (WELD, 6, 0)])
def test_closures_of_onshape_are_loops(closure, rows, dof, tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(four_bar(closure))
    model, report = pg.read_mjcf(path)
    assert report.loaded
    mech = pg.Mechanism(model)
    found = mech.mobility()
    assert (found.rows, found.dof) == (rows, dof)
    q, _, changed = mech.assemble()
    assert changed.moved < 1e-5  # the file has six digits
    if dof:
        run = pg.simulate(model, t_end=0.2, dt=1e-3)
        last = mech.assemble(np.array(run.q[-1]))[2]
        assert last.moved < 1e-8

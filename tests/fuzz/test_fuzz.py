"""The fuzz test for runs that are wrong without a notice: its judge, and a slice of it."""

import os

import numpy as np
import pytest

from .judge import FAMILIES, hunt, judged, ratios, scenes, told

EXPLORE = "PGRAPH_EXPLORE" in os.environ
REST = [name for k, name in enumerate(FAMILIES) if k % 4]
NIGHTLY = [pytest.param(name, marks=pytest.mark.nightly) for name in REST]


def silent(finds):
    return [find for find in finds if find.verdict == "silent"]


@pytest.mark.parametrize("family", [*list(FAMILIES)[::4], *NIGHTLY])
def test_no_run_of_a_slice_is_wrong_without_a_notice(family):
    finds = []
    for number in range(2):
        scene = FAMILIES[family](np.random.default_rng([number, 77]))
        finds += judged(scene, np.random.default_rng([number, 78]))
    assert not silent(finds), told(silent(finds), 0.0)
    assert any(find.verdict == "right" for find in finds)


def test_scenes_depend_on_seed_and_number_only():
    one, two = list(scenes(12, 5)), list(scenes(20, 5))
    assert [scene.what for scene in one] == [scene.what for scene in two[:12]]
    assert [scene.what for scene in scenes(8, 5, 12)] == [scene.what for scene in two[12:]]


def test_the_judge_finds_a_wrong_closed_form():
    scene = FAMILIES["pendulum"](np.random.default_rng(3))
    known = scene.known
    assert known is not None
    wrong = scene._replace(known=lambda t: 1.001 * known(t))
    default = next(judged(wrong, np.random.default_rng(0)))
    assert default.verdict == "silent"
    assert "pendulum" in told([default], 0.0)


@pytest.mark.nightly
def test_2000_scenes():
    """Each scene has three runs. Scenes are new every night, from a printed seed."""
    seed = int(np.random.SeedSequence().generate_state(1)[0]) if EXPLORE else 0
    finds = list(hunt(2000, seed))
    print(f"seed {seed}:\n{told(finds, 0.0)}")
    assert not silent(finds)
    ratio = ratios(finds)
    assert np.mean((ratio > 0.2) & (ratio < 10.0)) >= 0.97

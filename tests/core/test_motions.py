"""Kinds of motion: their facts agree with the description, and no other file asks for a kind."""

import math
import re
from pathlib import Path

import numpy as np

import pgraph_core as pg
from pgraph_core.engine.motions import MOTIONS
from pgraph_core.engine.motions.contract import Motion
from pgraph_core.joints import CODES, KINDS
from pgraph_core.joints import Motion as Joint

CORE = Path(pg.__file__).parent


def test_facts_of_motions_are_those_of_the_description():
    assert [one.number for one in MOTIONS] == list(range(len(MOTIONS)))
    for kind, facts in KINDS.items():
        one = MOTIONS[int(CODES[kind])]
        assert (one.coordinates, one.freedoms) == (len(facts.q), len(facts.v)), kind
        assert one.attitude == facts.attitude, kind
        assert one.angle == (facts.q == ("rad",)), kind
        assert one.travels == facts.travels, kind
        assert one.turns == (facts.turns and facts.directed), kind
        assert not one.inert, kind


def test_a_kind_turns_travels_and_pivots_as_its_geometry_says():
    """A pivot is where a whole turn changes nothing, which a screw and a slide are not."""
    track, rng = (
        pg.Track(points=[(0, 0, 0), (1, 0, 0.5), (1, 1, 0)], up=(0, 0, 1)),
        np.random.default_rng(0),
    )
    for kind, facts in KINDS.items():
        motion = Joint(kind, (0.6, 0.0, 0.8), 0.1, track if facts.tracked else None)
        q = np.array(facts.home) + 0.1 * rng.random(len(facts.q))
        there, back = (facts.rotation(motion, np.eye(3), x) for x in (q, np.array(facts.home)))
        moved = facts.displacement(motion, np.eye(3), q)
        assert (not np.array_equal(there, back)) == facts.turns, kind
        assert moved.any() == facts.travels, kind
        if facts.single and not facts.tracked:
            around = q + math.tau
            same = np.allclose(facts.rotation(motion, np.eye(3), around), there, atol=1e-12)
            same &= np.allclose(facts.displacement(motion, np.eye(3), around), moved, atol=1e-12)
            assert same == facts.pivots, kind


def test_every_motion_answers_every_question():
    for one in MOTIONS:
        missing = [name for name in Motion._fields if getattr(one, name) is None]
        assert not missing, (one.number, missing)


def test_only_motions_and_tables_name_a_kind():
    names = re.compile(r"\b(?:at|layout)\.(ROTATE|SCREW|TRANSLATE|BALL|FREE|CURVE|WIRE|STATE)\b")
    found = {
        str(path.relative_to(CORE))
        for path in CORE.rglob("*.py")
        if path.parent.name != "motions" and names.search(path.read_text(encoding="utf-8"))
    }
    assert found == {"packing/packed.py"}, "ask a question of `engine.motions` instead"


def test_a_second_pass_with_kept_frames_gives_the_bits_of_a_whole_one():
    """Time stepping takes frames and inertias of its first pass, unless a user's function may have
    written into them. A function that adds nothing therefore leaves the motion as it is."""
    kinds = ("revolute", "screw", "prismatic", "spherical", "universal")
    bodies = [pg.Body(name="slide", joint="prismatic", mass=1.0, friction=0.2, axes=(0, 0, 1))]
    for n, joint in enumerate(kinds):
        bodies.append(
            pg.Body(
                name=f"b{n}", parent=bodies[-1].name, joint=joint, position=(0.2, 0.0, 0.1),
                mass=1.0, com=(0.1, 0.05, 0.0), inertia=(0.01, 0.02, 0.03),
            )
        )  # fmt: skip
    mech = pg.Mechanism(pg.Model(bodies=tuple(bodies)))
    v = np.linspace(-1.0, 1.0, mech.nv)
    given = {"t_end": 0.2, "step": 2e-3, "method": "moreau_jean", "v": v, "estimate": False}
    kept = pg.simulate(mech, **given)
    whole = pg.simulate(mech, tau=lambda t, q, v: np.zeros(len(v)), **given)
    assert np.array_equal(kept.q, whole.q)
    assert np.array_equal(kept.v, whole.v)

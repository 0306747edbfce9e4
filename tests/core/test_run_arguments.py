"""Arguments of `simulate` that cannot be meant: a sentence, never an error of Python's."""

from __future__ import annotations

import pytest

import pgraph_core as pg

MECH = pg.Mechanism(pg.Model.serial(2))
LIST = "must be a list of pg.Force; given"
HINGE = "the joint of '1' has 1 degrees of freedom; given"


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"forces": 5}, f"simulate, forces: {LIST} 5"),
        ({"forces": ("a",)}, f"simulate, forces: {LIST} ('a',)"),
        (
            {"forces": [pg.Force(name="z", body="1", coordinate=1)]},
            f"force 'z', coordinate: {HINGE} 1",
        ),
        (
            {"forces": [pg.Force(name="z", kind="servo", body="1", coordinate=3, kp=1)]},
            f"force 'z', coordinate: {HINGE} 3",
        ),
        (
            {"forces": [pg.Force(name="z", body="nobody")]},
            "force 'z', body: no body is named 'nobody'; choose one of 1, 2",
        ),
        ({"rtol": "a"}, "simulate, rtol: must be a finite number > 0; given 'a'"),
        (
            {"progress": 3},
            "simulate, progress: must be a function of the fraction that is done; given 3",
        ),
    ],
)
def test_an_argument_that_cannot_be_meant_is_a_sentence(given, sentence):
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(MECH, t_end=0.01, **given)
    assert str(refused.value) == sentence

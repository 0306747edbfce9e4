"""The answers of reports and maps, tried: on built-in models, random trees, scenes of the hunt."""

from __future__ import annotations

import pytest

from benchmarks import answers

pytestmark = pytest.mark.nightly

LONGEST = 0.2  # [s] of a motion that has no length of its own
SUBJECTS = list(answers.subjects())


def short(subject: answers.Subject) -> answers.Subject:
    return subject._replace(t_end=subject.t_end or LONGEST)


@pytest.mark.parametrize("subject", SUBJECTS, ids=[each.name for each in SUBJECTS])
def test_what_a_report_advises_holds(subject: answers.Subject):
    found = answers.of_report(short(subject), longest=0.3)
    assert found.verdict != answers.WRONG, found.sentence


@pytest.mark.parametrize("subject", SUBJECTS, ids=[each.name for each in SUBJECTS])
def test_what_a_map_advises_holds(subject: answers.Subject):
    found = answers.of_map(short(subject), budget=200_000)
    assert found.verdict != answers.WRONG, found.sentence

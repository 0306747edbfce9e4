"""Verification cases: models with known motion, stored as data, and the comparison with it."""

from .cases import Case as Case
from .cases import States as States
from .cases import Verdict as Verdict
from .cases import load_cases as load_cases
from .cases import verify as verify

"""Cases: runs with a known answer, as data, and the check of what they should show."""

from .cases import Case as Case
from .cases import Verdict as Verdict
from .cases import load_cases as load_cases
from .cases import verify as verify

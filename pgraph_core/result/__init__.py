"""The result of a run: arrays over time, how it ended, and what its contacts did."""

from .result import Result as Result
from .result import Status as Status

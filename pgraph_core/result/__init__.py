"""The result of a run: arrays over time, how it ended, contacts and events."""

from .result import Result as Result
from .result import Status as Status

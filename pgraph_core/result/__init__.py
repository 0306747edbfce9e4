"""The result of a run: arrays over time, the final status, contacts and events."""

from .result import Result as Result
from .result import Status as Status

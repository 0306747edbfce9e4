"""The result of a run: arrays over time, the final status, contacts and events."""

from .records import Status as Status
from .result import Result as Result
from .runs import Runs as Runs

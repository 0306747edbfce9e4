"""The mechanism: what users hold, with its dynamics, derivatives, batches and scene."""

from .mechanism import Mechanism as Mechanism

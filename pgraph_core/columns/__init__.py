"""Columns: a table of bodies as columns of numbers, checked in bulk."""

from .columns import Columns as Columns

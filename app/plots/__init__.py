"""Curves of a run over time."""

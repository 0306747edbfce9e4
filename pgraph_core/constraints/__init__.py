"""Constraints: rows of kernels, loops that close, what moves, what is redundant or singular."""

"""Constraint rows, their Delassus matrix, rank-safe solution and projection."""

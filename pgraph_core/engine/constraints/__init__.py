"""Constraint rows, their Delassus matrix, and its rank-safe solution and projection."""

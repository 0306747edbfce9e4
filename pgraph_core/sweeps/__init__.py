"""Sweeps: one model at many values of its fields, each run on its own, on cores or a cluster.

`paths` says what is varied, `metrics` what is measured, `tasks` runs points, `sweep` keeps them.
"""

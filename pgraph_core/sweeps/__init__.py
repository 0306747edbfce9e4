"""Parameter sweeps: one model at many field values, with independent runs on cores or a cluster.

`paths` says what is varied, `metrics` what is measured, `tasks` runs points, `sweep` keeps them.
"""

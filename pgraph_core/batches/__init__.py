"""Batches of instances of one mechanism that are stepped together, each with its own parameters.

`paths` says which numbers differ, `instances` keeps them as rows of a table and steps free trees
side by side, `lanes` those that touch a plane. `batch_stepper` is what users hold.
"""

"""Studies, which are grids of runs of one mechanism compared with a reference.

`work_precision` measures error against run time over methods and settings, `stability_map` which
methods hold as a scene is made extreme.
"""

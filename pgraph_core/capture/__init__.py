"""Motion capture: markers and force plates in, joint angles, moments and inertias out.

`trial` holds what a laboratory has recorded, and `tables` and `c3d` read its files. `batch`
evaluates many frames at once.
"""

"""Numbers of MuJoCo and Pinocchio in files.

They are made by `python -m tests.golden.build` and `tests.golden.third_party` of commit 5e888c4,
with the versions of mujoco and pin that trees.json and third_party.json name.
"""

"""Kinematics and dynamics of trees: O(n) sweeps."""

"""Tests of the dynamics: laws, the paper's operators as oracle, simulation."""

"""Searches for numbers of a model: `fit` to measured curves, `optimise` for a goal."""

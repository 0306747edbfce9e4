"""The walking controller."""

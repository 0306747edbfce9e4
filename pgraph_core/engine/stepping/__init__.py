"""Integration methods, step loops, dense output, events."""

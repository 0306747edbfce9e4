"""Simulating: settings, background runs, live runs, exports."""

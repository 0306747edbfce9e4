"""The table of the bodies."""

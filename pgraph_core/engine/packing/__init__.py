"""From columns of numbers to the packed arrays of a mechanism."""

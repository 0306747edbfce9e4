"""The records of STEP_CONTROL: one module each has all functions that write it."""

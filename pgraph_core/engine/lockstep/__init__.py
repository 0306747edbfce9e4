"""Steps of many instances side by side in lanes, each bitwise identical to its own run."""

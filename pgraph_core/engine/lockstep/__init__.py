"""Steps of many instances side by side in lanes, each with the bits of its own run."""

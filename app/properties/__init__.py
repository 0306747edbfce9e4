"""Properties of the selected bodies, the model and its parameters."""

"""Properties of the selected bodies, of the model and its parameters."""

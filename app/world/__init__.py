"""Properties of the model itself, shown where no body is selected."""

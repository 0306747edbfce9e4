"""Walking: gaits, their settings, the phases and the prints of the feet."""

"""Open pages: coming and going, selecting, autosave."""

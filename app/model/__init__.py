"""The model itself: new, open, save, undo, redo, and what follows from it."""

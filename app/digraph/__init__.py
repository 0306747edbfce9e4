"""The digraph of the bodies: its layout, drawing, drag and drop, and the stepping through."""

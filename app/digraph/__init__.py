"""The digraph of the bodies: its layout, drawing, drag and drop, and step-by-step display."""

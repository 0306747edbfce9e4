"""Contact: what may touch what, sites that touch down and lift off, and their impacts."""

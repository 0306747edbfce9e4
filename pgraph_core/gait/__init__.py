"""Walking: a gait and a quadruped make a controller, which runs take as they take torques."""

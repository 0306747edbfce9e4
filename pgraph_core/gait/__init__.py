"""Walking controllers. A gait and a quadruped define a controller, which is passed to a run in
place of torques.
"""

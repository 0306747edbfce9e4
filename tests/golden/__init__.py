"""Numbers from MuJoCo and Pinocchio for random trees; `build.py` remakes them."""

"""Model files of other programs: URDF and MJCF, in and out, with a report of each."""

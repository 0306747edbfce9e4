"""Playing a run: play, scrub, step, speed, loop."""

"""Contact: collision candidates, touchdown and lift-off of sites."""

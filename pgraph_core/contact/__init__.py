"""Contact: collision candidates, touchdown and lift-off of sites, and impacts."""

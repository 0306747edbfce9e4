"""Reports: error against run time, and the stability map."""

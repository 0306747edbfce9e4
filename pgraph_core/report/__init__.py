"""Error against run time: what each method costs at which accuracy, as rows, figure and page."""

"""Where methods hold on stiff and extreme scenes: a verdict on each of many runs."""

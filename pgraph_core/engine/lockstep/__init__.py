"""Steps of many instances in SIMD lanes, with results that are bit-identical to single runs."""

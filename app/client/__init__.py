"""The few lines of script and style that viser lacks, and the one file that knows its insides."""

"""Models as files for other programs: a C library and FMUs, which need neither Python nor a
compiler."""

"""Files, ranks, progress, timing, signals and versions of dolfinx, for all other packages."""

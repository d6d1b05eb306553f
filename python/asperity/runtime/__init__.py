"""What every package uses of the machine: files, ranks, progress, timing, signals, versions of dolfinx."""

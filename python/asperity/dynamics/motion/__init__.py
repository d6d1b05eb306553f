"""Motion in time: trajectories, sweeps, shooting."""

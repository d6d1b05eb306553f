"""Runs with a tolerance: family of meshes, extrapolation, error bars, and the estimate before a run."""

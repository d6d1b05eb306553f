"""Periodic orbits: free vibration, harmonic balance, continuation, stability, thresholds."""

"""Static contact laws (force over approach), restoring force about a preload, damping models."""

"""Static laws of the contact and the damping: force over approach, and its restoring force about a preload."""

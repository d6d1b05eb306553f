"""Vibration of a mass on a contact, from the law of its force over the approach; NumPy and SciPy suffice."""

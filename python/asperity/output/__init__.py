"""Files of a run: folder, fields, results read back, comparison of curves."""

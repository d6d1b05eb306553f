"""Results of a run: fields, results read from a folder, comparison of curves, assumptions of the model."""

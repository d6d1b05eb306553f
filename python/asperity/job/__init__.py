"""The whole job of a case: its static part, what follows the load path, and the files of the run."""

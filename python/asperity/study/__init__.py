"""Studies: one case with some keys varied, run as independent cases distributed over the ranks of a job.

run_study(Study.load("study.toml"), "out/study")
"""

from asperity.study.definition import Entry, Study
from asperity.study.run import case_folder, run_study

__all__ = ["Entry", "Study", "case_folder", "run_study"]

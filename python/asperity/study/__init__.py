"""Studies: one case with some keys varied, run as independent cases distributed over the ranks of a job.

study = Study.load("study.toml")
run_study(study, "out/study")
results = StudyResults.read("out/study")
"""

from asperity.study.definition import Entry, Family, Study
from asperity.study.results import StudyLevel, StudyResults, summarise_case
from asperity.study.run import run_study

__all__ = [
    "Entry",
    "Family",
    "Study",
    "StudyLevel",
    "StudyResults",
    "run_study",
    "summarise_case",
]

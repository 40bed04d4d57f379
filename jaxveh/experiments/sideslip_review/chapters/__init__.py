"""The review chapter by chapter: every method of `jaxveh.estimators` in every scenario, on cars of fourteen degrees of
freedom."""

from jaxveh.experiments.sideslip_review.chapters.chapter_figures import chapter_figures
from jaxveh.experiments.sideslip_review.chapters.chapter_tables import chapter_tables
from jaxveh.experiments.sideslip_review.chapters.conclusions import CONCLUSIONS, conclusion_table
from jaxveh.experiments.sideslip_review.chapters.racing import ChaptersRaced, chapter_drives, race_methods
from jaxveh.experiments.sideslip_review.chapters.scenarios import SCENARIOS

__all__ = [
    "CONCLUSIONS",
    "SCENARIOS",
    "ChaptersRaced",
    "chapter_drives",
    "chapter_figures",
    "chapter_tables",
    "conclusion_table",
    "race_methods",
]

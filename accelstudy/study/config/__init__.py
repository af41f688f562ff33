"""The configuration of a study: its schema, and how it is read and checked."""

from accelstudy.study.config.blocks import Grid
from accelstudy.study.config.reading import config_schema, parse_study, read_study
from accelstudy.study.config.schema import StudyConfig

__all__ = [
    "Grid",
    "StudyConfig",
    "config_schema",
    "parse_study",
    "read_study",
]

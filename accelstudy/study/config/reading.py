"""From YAML to a checked configuration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import checked
from accelstudy.study.config.formulas import check_formulas
from accelstudy.study.config.schema import StudyConfig


def parse_study(content: Mapping[str, Any], source: str = "config") -> StudyConfig:
    """Check a configuration.

    Parameters
    ----------
    content : mapping, as read from YAML
    source : str, named in errors

    Raises
    ------
    InputError
        One line that names the source, the key, what is wrong and what would be right.
    """
    study = checked(StudyConfig, content, source)
    try:
        check_formulas(study)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return study


def read_study(*paths: str | Path) -> StudyConfig:
    """Read a configuration from YAML files; later ones overlay earlier ones key by key.

    Raises
    ------
    InputError
        If a file cannot be read, is no YAML mapping, or does not fit the schema.
    """
    content: dict[str, Any] = {}
    for path in paths:
        content = overlay(content, read_layer(path))
    return parse_study(content, ", ".join(str(path) for path in paths))


def config_schema() -> dict[str, Any]:
    """JSON schema of the configuration, as kept in `workflow/schemas/config.schema.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **StudyConfig.model_json_schema(),
    }

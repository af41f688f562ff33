"""The configuration of a study: its schema, and how it is read and checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.design.estimability import estimability
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import checked
from accelstudy.simulation.sessions import Noise
from accelstudy.study.config.blocks import HOLD_KEYS, Grid, SensitivityConfig
from accelstudy.study.config.schema import Study

__all__ = ["Grid", "Study", "config_schema", "named_files", "parse_study", "read_study"]


def parse_study(content: Mapping[str, Any], source: str = "config") -> Study:
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
    study = checked(Study, content, source)
    try:
        _check_formulas(study)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return study


def read_study(*paths: str | Path) -> Study:
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


def named_files(content: Any) -> list[str]:
    """Files that a configuration names: of schemes, models and plug-ins."""
    if isinstance(content, str):
        named = content.endswith((".yaml", ".yml", ".py")) and Path(content).is_file()
        return [content] if named else []
    if isinstance(content, Mapping):
        content = [*content, *content.values()]
    if not isinstance(content, list):
        return []
    return sorted({path for each in content for path in named_files(each)})


def config_schema() -> dict[str, Any]:
    """JSON schema of the configuration, as kept in `workflow/schemas/config.schema.json`."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Study.model_json_schema(),
    }


def _check_formulas(study: Study) -> None:
    """Check that effects get the conditions they need, and that leveling can be analysed.

    This needs the formulas of the models and takes half a second. The schema does without: jobs
    read a configuration that the workflow has checked.

    Raises
    ------
    InputError
        One line that names the key, what is wrong and what would be right.
    """
    _check_conditions(study)
    if study.sensitivity is not None:
        _check_sensitivity(study, study.sensitivity)


def _check_conditions(study: Study) -> None:
    """Check that the plan of the holds has each condition that an effect depends on."""
    plan, simulated = study.hold_plan, study.simulated_effects
    models = [model for grid in study.grids for model in grid.models]
    models += [] if simulated is None else [simulated]
    for effect in {e.spec: e for model in models for e in model.effects}.values():
        if column := plan.missing(effect):
            raise InputError(
                f"{HOLD_KEYS[column]}: missing; the effect {effect.name!r} needs the {column} of "
                "each hold"
            )


def _check_sensitivity(study: Study, settings: SensitivityConfig) -> None:
    """Check that the cells of the sensitivity analysis can be estimated."""
    if settings.model.hold_columns:
        raise InputError(
            f"sensitivity.model: {settings.model.name!r} depends on the "
            f"{settings.model.hold_columns[0]} of each hold, "
            "and leveling is analysed without; choose another model"
        )
    noise = Noise(sigma_gravity=study.noise.gravity.sigma_mps2)
    for approach in ("gravity", "robot"):
        cell = f"sensitivity: {settings.cell(approach)}"
        design = estimability(settings.scheme, settings.model, get_approach(approach), noise)
        if not design.estimable:
            raise InputError(f"{cell} cannot be estimated: {design.reason}")
        if study.paper and design.redundancy == 0:
            raise InputError(f"{cell} has no redundancy, which paper: true needs")

"""Sensor models by their names.

A person writes a model in one of three ways: by the name of a registered model; as registered
models and effects joined by + (``bias-scale-nonorthogonality+warm_up(tau=300)``); or as the path of
a YAML file with a model, such as the `model.yaml` of a diagnosis.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

from accelstudy.basics.errors import InputError, UnknownNameError, locate_errors
from accelstudy.basics.plugins import HOW, cached_lookup, explain_missing
from accelstudy.effects import Effect, effect_names, get_effect, is_effect
from accelstudy.files.reading import read_layer
from accelstudy.sensors.sensor import SensorModel

MODEL_FILE = "model.yaml"
"""Name of the file in which a diagnosis writes a model."""

_NINE = ("bias", "scale", "nonorthogonality")
NINE = "bias-scale-nonorthogonality"
"""Name of the model of nine parameters, which is taken where none is given."""
MODELS: dict[str, tuple[str, ...]] = {
    "bias-scale": ("bias", "scale"),
    NINE: _NINE,
    f"{NINE}-crossaxis": (*_NINE, "cross_axis_misalignment"),
    f"{NINE}-quadratic": (*_NINE, "quadratic_scale"),
    f"{NINE}-cubic": (*_NINE, "cubic_scale"),
    f"{NINE}-quadratic-cubic": (*_NINE, "quadratic_scale", "cubic_scale"),
}
"""Name -> effects (Thalmann & Neuner 2018, section 2; nonlinear scale after Cai 2013)."""


def get_model(text: str, extra: Mapping[str, SensorModel] | None = None) -> SensorModel:
    """Return a model by its name, its effects, or a YAML file.

    Parameters
    ----------
    text : str
        A name; parts joined by +, each a registered model or an effect with its settings; or the
        path of a YAML file, of which the name of one of its models may follow after a colon. A
        path has a separator or ends in .yaml or .yml.
    extra : mapping of name to SensorModel, optional
        Models defined by the caller, beside the registered ones.

    Returns
    -------
    SensorModel
        A composition and the model of a file have the name that `composition_name` gives them.

    Raises
    ------
    UnknownNameError
        If there is no such model, or an effect of it does not exist.
    InputError
        If an effect occurs twice, a setting cannot be read, or a file has not one model.
    """
    text = text.strip()
    if extra and text in extra:
        return extra[text]
    if text in MODELS:
        return compose(text, MODELS[text])
    if text and os.path.isfile(inside := os.path.join(text, MODEL_FILE)):
        raise InputError(f"{text}: a folder, not a model; take {inside}")
    if path := re.fullmatch(rf"(.*(?:\.ya?ml|[/{re.escape(os.sep)}].*?))(?::([\w-]+))?", text):
        return _model_of_file(path[1], path[2])
    parts = [part.strip() for part in re.split(r"\+(?![^()]*\))", text)]
    if len(parts) == 1 and not _is_effect(text):
        raise UnknownNameError("model", text, (*MODELS, *(extra or ())))
    specs: list[str] = []
    for part in parts:
        if not part:
            raise InputError(f"model {text!r}: a part is empty; write models and effects between +")
        if part not in MODELS and not _is_effect(part):
            known = (*MODELS, *effect_names())
            raise UnknownNameError("model or effect", part, known, HOW)
        specs += MODELS.get(part, (part,))
    return _composed(specs, text)


def composition_name(effects: Sequence[Effect]) -> str:
    """Name of a composition: the longest registered model that it begins with, and the rest.

    The same effects with the same settings in the same order always have one name, which
    `get_model` takes.
    """
    specs = tuple(effect.spec for effect in effects)
    begins = [name for name, effects_of in MODELS.items() if specs[: len(effects_of)] == effects_of]
    base = max(begins, key=lambda name: len(MODELS[name]), default=None)
    if base is None:
        return "+".join(specs)
    return "+".join((base, *specs[len(MODELS[base]) :]))


@cached_lookup
def compose(name: str, effects: tuple[str, ...]) -> SensorModel:
    """Compose a model of effects; the same model, traced once, for the same arguments."""
    return SensorModel.of(name, effects)


def _is_effect(text: str) -> bool:
    return is_effect(re.split(r"[(\[\s]", text)[0])


def _composed(specs: Sequence[str], source: str) -> SensorModel:
    """Compose a model and name it."""
    effects = [get_effect(spec) for spec in specs]
    names = [effect.name for effect in effects]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"model {source!r}: the effect {twice[0]!r} is in it twice")
    return compose(composition_name(effects), tuple(effect.spec for effect in effects))


def _model_of_file(path: str, name: str | None) -> SensorModel:
    """Model of a YAML file: the one under `models`, or the one of these that is asked for.

    A file without `models` has the model of its `simulated_effects`. A diagnosis that added nothing
    writes its base model in this way.
    """
    content = read_layer(path)
    models: Any = content.get("models") or {}
    if not isinstance(models, Mapping):
        raise InputError(f"{path}: models: must be a mapping of names to lists of effects")
    if name is None and not models and isinstance(content.get("simulated_effects"), list):
        key, effects = "simulated_effects", content["simulated_effects"]
    elif name is None and len(models) == 1:
        ((only, effects),) = models.items()
        key = f"models.{only}"
    elif name in models:
        key, effects = f"models.{name}", models[name]
    elif not models:
        raise InputError(f"{path}: no model in it; expected `models:` with a name and its effects")
    elif name is not None:
        raise InputError(f"{path}: no model {name!r} in it; it has {', '.join(map(str, models))}")
    else:
        raise InputError(
            f"{path}: several models ({', '.join(map(str, models))}); write which one after a "
            f"colon, as {path}:{next(iter(models))}"
        )
    effects = [effects] if isinstance(effects, str) else effects
    if not isinstance(effects, list) or not effects or not all(isinstance(e, str) for e in effects):
        raise InputError(f"{path}: {key}: must be a list of effects")
    with explain_missing(content, path), locate_errors(f"{path}: {key}"):
        return _composed(effects, str(name or key.removeprefix("models.")))

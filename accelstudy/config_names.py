"""The types of the names of models and schemes in a configuration."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator


def _model_name(text: str) -> str:
    from accelstudy.sensors.models import get_model  # slow to import, and most keys need no model

    # A plain name may be that of a model that the configuration itself defines.
    return text if re.fullmatch(r"[\w-]+", text) else get_model(text).name


def _scheme_name(text: str) -> str:
    from accelstudy.schemes import get_scheme, is_scheme_file  # as above

    return get_scheme(text).name if is_scheme_file(text) else text


def _known_model(name: str) -> str:
    from accelstudy.sensors.models import get_model  # as above

    get_model(name)
    return name


ModelName = Annotated[str, AfterValidator(_model_name)]
"""The name of a model; a composition and a file get the name that follows from their effects."""
KnownModel = Annotated[ModelName, AfterValidator(_known_model)]
"""The name of a model where a configuration defines none of its own."""
SchemeName = Annotated[str, AfterValidator(_scheme_name)]
"""The name of a scheme; that of a file contains a digest of its directions."""

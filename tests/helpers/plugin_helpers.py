"""Plug-ins within the process of the tests, which forgets them."""

import contextlib

from accelstudy.approaches import base as approaches
from accelstudy.basics import plugins
from accelstudy.data_sheets import reading
from accelstudy.effects import base as effects
from accelstudy.noise_effects import base as noise_effects
from accelstudy.schemes import registry as schemes
from accelstudy.study.figures import registry as figures

REGISTRIES = {
    "effects": effects._registry,
    "noise_effects": noise_effects._registry,
    "schemes": schemes._registry,
    "approaches": approaches._registry,
    None: figures._REGISTRY,
}
"""Registries, by the room for which packages may have something."""


@contextlib.contextmanager
def forgotten():
    """Forget all that is registered within the block; installed packages are looked for again."""
    changed = [registry._items for registry in REGISTRIES.values()]
    changed += [plugins._files, plugins._sources]
    before = [dict(each) for each in changed]
    for room, registry in REGISTRIES.items():
        registry._room = room
    _clear()
    try:
        yield
    finally:
        for each, kept in zip(changed, before, strict=True):
            each.clear()
            each.update(kept)
        _clear()


def _clear():
    for cache in (*plugins._lookups, reading._files, reading._shipped):
        cache.cache_clear()

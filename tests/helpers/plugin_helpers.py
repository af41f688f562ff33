"""Plug-ins within the process of the tests, which forgets them."""

import contextlib

from accelstudy.approaches import base as approaches
from accelstudy.basics import plugins
from accelstudy.data_sheets import reading
from accelstudy.drawing import style
from accelstudy.effects import base as effects
from accelstudy.noise_effects import base as noise_effects
from accelstudy.schemes import registry as schemes
from accelstudy.sensors import models

REGISTRIES = [room._registry for room in (effects, noise_effects, schemes, approaches)]
CACHES = (
    *(effects.get_effect, noise_effects.get_noise_effect, schemes._registered),
    *(style._parameters, models.compose, reading._files, reading._shipped),
)


@contextlib.contextmanager
def forgotten():
    """Forget all that is registered within the block; installed packages are looked for again."""
    rooms = ("effects", "noise_effects", "schemes", "approaches")
    changed = [registry._items for registry in REGISTRIES]
    changed += [plugins._files, plugins._sources]
    before = [dict(each) for each in changed]
    for registry, room in zip(REGISTRIES, rooms, strict=True):
        registry._room = room
    for cache in CACHES:
        cache.cache_clear()
    try:
        yield
    finally:
        for each, kept in zip(changed, before, strict=True):
            each.clear()
            each.update(kept)
        for cache in CACHES:
            cache.cache_clear()

"""Check that the files of the repository that a page names are there."""

import logging
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"`((?:accelstudy|benchmarks|config|docs|examples|profiles|workflow)/[\w/.-]*)`")

log = logging.getLogger("mkdocs.hooks.paths")


def on_page_markdown(markdown, page, **_):
    """Warn of what is missing; a strict build then fails."""
    for name in dict.fromkeys(NAMED.findall(markdown)):
        if not (ROOT / name).exists():
            log.warning("%s names %s, which does not exist", page.file.src_uri, name)

"""Pages work from a file: nothing is loaded from outside, though links may lead there."""

import re

from mkdocs.exceptions import PluginError

LOADS = re.compile(
    r"""<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=["']?((?:https?:)?//[^"'\s>]+)"""
    r"""|url\(["']?((?:https?:)?//[^"')]+)"""
)


def on_post_page(output, page, **_):
    """Refuse a page that is not complete without a network."""
    if found := LOADS.search(output):
        raise PluginError(f"{page.file.src_uri} loads {found[1] or found[2]}")

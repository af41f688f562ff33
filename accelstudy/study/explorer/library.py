"""What draws charts in a browser: Vega-Embed, as one packed text of JavaScript."""

from __future__ import annotations

import base64
import gzip
from importlib.metadata import version

from accelstudy.files.kept import keep, kept

BUNDLED = "window.vegaEmbed = vegaEmbed;"
"""What the page finds of it."""


def library() -> str:
    """Return Vega-Embed, with all it needs, as vl-convert bundles it, gzipped, in base 64.

    To bundle it takes two seconds, so the text is kept for the next study.
    """
    key = f"vega-{version('vl-convert-python')}"
    packed = kept("explorer", key)
    if packed is None:
        import vl_convert

        code = vl_convert.javascript_bundle(BUNDLED)
        packed = base64.b64encode(gzip.compress(code.encode(), mtime=0))
        keep("explorer", key, packed)
    return packed.decode()

"""Pages work from a file: nothing is loaded from outside, and the page of errors has its style.

Links that a reader follows may lead outside.
"""

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


def on_post_template(output_content, template_name, **_):
    """Let 404.html find its style beside itself when opened as a file.

    A server shows it at any depth; there its links begin at the root, as they did.
    """
    if template_name != "404.html":
        return output_content
    base = "<script>if(location.protocol!='file:')document.write('<base href=\"/\">')</script>"
    return re.sub(r'((?:href|src)=")/(?!/)', r"\1", output_content).replace(
        "<head>", f"<head>{base}", 1
    )

"""Draw the formulas of a page, so that it needs neither script nor font."""

import html
import re

from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextPath, text_to_path

FONT = FontProperties(size=100, math_fontfamily="stix")
"""Its size is 100 units an em."""
LETTERS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C"}


def svg(tex):
    """A formula as SVG, as large as the text around it and on its baseline.

    Parameters
    ----------
    tex : str
        TeX without dollars, of the kind that Matplotlib's mathtext knows.
    """
    text = f"${tex}$"
    width, height, depth = text_to_path.get_text_width_height_descent(text, FONT, ismath=True)
    parts = []
    for points, code in TextPath((0, 0), text, prop=FONT).iter_segments():
        points = [f"{x:.0f} {-y:.0f}" for x, y in points.reshape(-1, 2)]
        parts.append("Z" if code == Path.CLOSEPOLY else LETTERS[code] + " ".join(points))
    box = f"0 {depth - height:.0f} {width:.0f} {height:.0f}"
    style = (
        f"width:{width / 100:.2f}em;height:{height / 100:.2f}em;vertical-align:{-depth / 100:.2f}em"
    )
    return (
        f'<svg role="img" aria-label="{html.escape(tex)}" viewBox="{box}" style="{style}">'
        f'<path d="{"".join(parts)}"/></svg>'
    )


MARKED = re.compile(r'<(span|div) class="arithmatex">\s*\\[\[(](.*?)\\[\])]\s*</\1>', re.DOTALL)
"""What arithmatex made of a formula within a line, or of one on lines of its own."""


def on_page_content(content, page, **_):
    """Replace the formulas that arithmatex marked; one that cannot be drawn ends the build."""

    def drawn(found):
        lines = (" ".join(line.split()) for line in html.unescape(found[2]).split(r"\\"))
        try:
            rows = "".join(f"<span>{svg(line)}</span>" for line in lines if line)
        except ValueError as error:
            raise ValueError(f"{page.file.src_uri}: cannot draw ${found[2]}$: {error}") from None
        return f'<{found[1]} class="formula">{rows}</{found[1]}>'

    return MARKED.sub(drawn, content)

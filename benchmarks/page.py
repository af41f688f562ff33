"""A page with tables that a run makes anew."""

import re


def put(page, name, text):
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->`.

    Raises
    ------
    ValueError
        If the page has no such place.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    pattern = re.escape(begin) + ".*?" + re.escape(end)
    if not re.search(pattern, page, flags=re.DOTALL):
        raise ValueError(f"no place for the table {name!r}")
    return re.sub(pattern, lambda _: f"{begin}\n{text}\n\n{end}", page, flags=re.DOTALL)

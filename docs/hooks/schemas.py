"""Tables of what may stand in a file, from its JSON schema."""

import json
import math
import re

from markdown_text import code, page, plain, table

HEADS = ("key", "type", "default", "meaning")
PLAIN = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}


def blocks(schema, title, before=""):
    """Describe a schema block by block, each under a heading.

    Parameters
    ----------
    schema : dict, JSON schema with its `$defs`
    title : str, of the outermost block
    before : str, what the headings begin with, so that no two of a page are alike
    """
    known = schema.get("$defs", {})
    parts = [f"## {title}" if title else "", _sentence(schema.get("description", ""))]
    places = {}

    def add(block, name):
        rows, inner = [], []
        for key, value in block.get("properties", {}).items():
            links = []
            text, path = _type(value, known, links), f"{before}{name}{key}"
            for link in links:
                if link not in places:
                    places[link] = path
                    inner.append((path, known[link]))
                text = text.replace("block", f"[block](#{_anchor(places[link])})")
            meaning = plain(value.get("description", "")) or _about(links, known)
            default = _default(value, key in block.get("required", ()))
            rows.append((code(key), text, default, meaning))
        parts.append(table(HEADS, rows))
        for path, own in inner:
            parts.append(f"### `{path}` {{ #{_anchor(path)} }}")
            parts.append(_sentence(own.get("description", "")))
            add(own, f"{path.removeprefix(before)}.")

    add(schema, "")
    return page(*parts)


def _anchor(path):
    return re.sub(r"[^a-z0-9]+", "-", path.lower()).strip("-")


def _about(links, known):
    return _sentence(known[links[0]].get("description", "")) if links else ""


def _sentence(text):
    for heading in ("Parameters", "Attributes"):
        text = text.partition(f"\n\n{heading}\n")[0]
    return plain(" ".join(text.split()))


def _default(value, required):
    if required:
        return "*required*"
    if "default" not in value or isinstance(value["default"], dict):
        return ""
    default = value["default"]
    return "" if default is None or default == [] else code(json.dumps(default, ensure_ascii=False))


def _type(value, known, links):
    """What a value may be; blocks of their own are added to `links`."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        if "properties" in known[name]:
            links.append(name)
            return "block"
        return _type(known[name], known, links)
    if "const" in value:
        return code(json.dumps(value["const"]))
    if "enum" in value:
        return " or ".join(code("null" if each is None else each) for each in value["enum"])
    if any_of := value.get("anyOf") or value.get("oneOf"):
        kinds = [_type(each, known, links) for each in any_of if each.get("type") != "null"]
        ones = [k for k in kinds if f"list of {k}" not in kinds and f"list of: {k}" not in kinds]
        if len(ones) < len(kinds):  # one, or a list of such
            return " or ".join(kind.replace("list of", "one or more of", 1) for kind in ones)
        return " or ".join(dict.fromkeys(kinds))
    if value.get("type") == "array":
        if "prefixItems" in value:
            return f"{len(value['prefixItems'])} numbers"
        inner = _type(value.get("items", {}), known, links)
        return f"list of {inner}" if inner else "list"
    if value.get("type") == "object" or "properties" in value:
        inner = value.get("additionalProperties")
        kind = _type(inner, known, links) if isinstance(inner, dict) else ""
        return f"{kind} for each name" if kind else "block"
    kind = value.get("type", "")
    if isinstance(kind, list):
        kind = next(k for k in kind if k != "null")
    return f"{PLAIN.get(kind, kind)}{_range(value)}"


def _range(value):
    low = value.get("minimum", value.get("exclusiveMinimum"))
    high = value.get("maximum", value.get("exclusiveMaximum"))
    if low is None and high is None:
        return ""
    ends = [
        f"{word} {end:.6g}"
        for word, end in (
            ("above" if "exclusiveMinimum" in value else "from", low),
            ("below" if "exclusiveMaximum" in value else "to", high),
        )
        if end is not None and math.isfinite(end)
    ]
    return f" {', '.join(ends).replace(', to', ' to')}"

"""Tables of what may stand in a file, from its JSON schema."""

import json
import re
from pkgutil import resolve_name

from markdown_text import code, page, plain, table

HEADS = ("key", "type", "default", "meaning")
PLAIN = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false"}
ENDS = {
    "minimum": "from",
    "exclusiveMinimum": "above",
    "maximum": "to",
    "exclusiveMaximum": "below",
}


def keys(source, before=""):
    """Describe the keys of a file block by block, each under a heading.

    Parameters
    ----------
    source : str, a model of pydantic or a function that returns its schema, as ``module:name``
    before : str, what the headings begin with, so that no two of a page are alike
    """
    made = resolve_name(source)
    schema = getattr(made, "model_json_schema", made)()
    known, places = schema.get("$defs", {}), {}

    def described(block, path):
        """A block, and those that are first named in it."""
        rows, inner = [], []
        for key, value in block.get("properties", {}).items():
            links = []
            text = _type(value, links)
            for link in links:
                if link not in places:
                    places[link] = f"{path}{key}"
                    inner.append(link)
                text = text.replace("block", f"[block](#{_anchor(before + places[link])})")
            meaning = plain(value.get("description", "")) or "".join(
                _sentence(known[link]) for link in links[:1]
            )
            default = _default(value, key in block.get("required", ()))
            rows.append((code(key), text, default, meaning))
        yield from (_sentence(block), table(HEADS, rows))
        for name in inner:
            heading = before + places[name]
            yield f"### `{heading}` {{ #{_anchor(heading)} }}"
            yield from described(known[name], f"{places[name]}.")

    return page(*described(schema, ""))


def _anchor(path):
    return re.sub(r"[^a-z0-9]+", "-", path.lower()).strip("-")


def _sentence(block):
    """What a block says of itself."""
    return plain(" ".join(block.get("description", "").split()))


def _default(value, required):
    default = value.get("default")
    if required or default in (None, []) or isinstance(default, dict):
        return "*required*" if required else ""
    return code(json.dumps(default, ensure_ascii=False))


def _type(value, links):
    """What a value may be; blocks of their own are added to `links`."""
    kind = value.get("type", "")
    if "$ref" in value:
        links.append(value["$ref"].rpartition("/")[2])
        return "block"
    if words := value.get("enum", [value["const"]] if "const" in value else ()):
        return " or ".join(code("null" if each is None else each) for each in words)
    if any_of := value.get("anyOf"):
        kinds = (_type(each, links) for each in any_of if each.get("type") != "null")
        return " or ".join(dict.fromkeys(kinds))
    if "prefixItems" in value:
        return f"{len(value['prefixItems'])} numbers"
    if kind == "array":
        return f"list of {_type(value.get('items', {}), links)}".removesuffix(" of ")
    if kind == "object":
        inner = value.get("additionalProperties")
        inner = _type(inner, links) if isinstance(inner, dict) else ""
        return f"{inner} for each name" if inner else "block"
    ends = [f"{word} {value[key]:.6g}" for key, word in ENDS.items() if key in value]
    return f"{PLAIN.get(kind, kind)} {', '.join(ends).replace(', to', ' to')}".strip()

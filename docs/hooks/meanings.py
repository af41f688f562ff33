"""Docstrings of the Python pages: apart what a parameter is and what it means."""

import inspect
import re
from importlib import import_module

import griffe

ITEM = re.compile(
    r"^(\s*)(\S.*?) : (?!optional)((?:[^,;\n()\[\]{}]|\([^()]*\)|\[[^\[\]]*\]|\{[^{}]*\})*)[,;] "
    r"*(?!optional)(\S.*)",
    re.MULTILINE,
)
"""Indent, name, type, and what follows it on the line."""


def apart(text):
    """Docstring whose lines `name : type, meaning` have the meaning on a line of its own."""
    return ITEM.sub(r"\1\2 : \3\n\1    \4", text)


class Meanings(griffe.Extension):
    """Rewrites docstrings before they are parsed."""

    def on_object(self, *, obj, **_):
        """Rewrite one; that of a verb has the meanings of the kinds of its keywords, too."""
        verb = obj.path.startswith("accelstudy.verbs.") and obj.parent.is_module
        if obj.docstring and obj.is_function and verb:
            module = import_module(obj.parent.path)
            obj.docstring.value = inspect.getdoc(getattr(module, obj.name))
        if obj.docstring:
            obj.docstring.value = apart(obj.docstring.value)

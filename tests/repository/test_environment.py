"""The locked environment is the declared one: pyproject.toml, uv.lock and its exports agree."""

import re
import subprocess
import tomllib
from collections import Counter

import pytest
from places import ROOT

MAKEFILE = (ROOT / "Makefile").read_text()
LOCK = re.search(r"^\tuv lock --upgrade (.*)$", MAKEFILE, re.M)[1]
EXPORTS = re.findall(r"^\tuv (export .*) --output-file (.*)$", MAKEFILE, re.M)
"""What `make lock` does."""
PUBLIC = ("https://pypi.org/simple", "https://files.pythonhosted.org/packages/")


def uv(*words):
    done = subprocess.run(["uv", *words, "--offline"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, f"{done.stderr}\nthen: make lock"
    return done.stdout


def test_uv_lock_is_of_this_pyproject():
    uv("lock", "--check", *LOCK.split())


@pytest.mark.parametrize(("words", "name"), EXPORTS)
def test_an_export_is_of_uv_lock(words, name):
    exports = (uv(*words.split()), (ROOT / name).read_text())
    ours, kept = (re.sub(r"^ *#.*\n", "", text, flags=re.M) for text in exports)
    assert ours == kept


def test_each_package_is_locked_in_one_version():
    packages = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    counts = Counter(package["name"] for package in packages)
    assert [name for name, count in counts.items() if count > 1] == []


@pytest.mark.parametrize("name", ["uv.lock", *(name for _, name in EXPORTS)])
def test_locks_name_public_addresses_only(name):
    addresses = re.findall(r"\w+://[^\s\"']+", (ROOT / name).read_text())
    assert [address for address in addresses if not address.startswith(PUBLIC)] == []

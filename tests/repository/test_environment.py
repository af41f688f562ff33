"""The locked environment is the declared one: pyproject.toml, uv.lock and its exports agree."""

import os
import re
import subprocess
import tomllib
from collections import Counter

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from places import ROOT

EXPORTS = ["requirements.lock", "requirements-build.lock"]
PUBLIC = ("https://pypi.org/simple", "https://files.pythonhosted.org/packages/")

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
UV_LOCK = tomllib.loads((ROOT / "uv.lock").read_text())
PACKAGES = [package for package in UV_LOCK["package"] if package["name"] != "accelstudy"]


def declared():
    """All requirements in pyproject.toml, those of the project first."""
    groups = PROJECT["project"]["optional-dependencies"] | PROJECT["dependency-groups"]
    entries = [entry for group in groups.values() for entry in group if isinstance(entry, str)]
    return [Requirement(entry) for entry in PROJECT["project"]["dependencies"] + entries]


def exported(name):
    """The requirements of an exported lock with their hashes, {Requirement: {"sha256:…"}}."""
    lines = re.sub(r"^ *#.*\n", "", (ROOT / name).read_text(), flags=re.MULTILINE)
    entries = (entry.split() for entry in lines.replace("\\\n", "").splitlines())
    return {
        Requirement(" ".join(word for word in words if not word.startswith("--hash="))): {
            word.removeprefix("--hash=") for word in words if word.startswith("--hash=")
        }
        for words in entries
    }


def test_each_package_is_locked_in_one_version():
    counts = Counter(package["name"] for package in PACKAGES)
    assert [name for name, count in counts.items() if count > 1] == []


def test_uv_lock_is_of_this_pyproject():
    (locked,) = (package for package in UV_LOCK["package"] if package["name"] == "accelstudy")
    metadata = locked["metadata"]
    groups = metadata["requires-dev"].values()
    recorded = {
        f"{entry['name']}{entry.get('specifier', '')}"
        for entries in (metadata["requires-dist"], *groups)
        for entry in entries
    }
    assert {str(Requirement(entry)) for entry in recorded} == {
        f"{canonicalize_name(requirement.name)}{requirement.specifier}"
        for requirement in declared()
    }
    assert UV_LOCK["requires-python"].replace(" ", "") == PROJECT["project"]["requires-python"]


@pytest.mark.parametrize("requirement", declared(), ids=str)
def test_declared_requirement_is_met(requirement):
    (version,) = (
        package["version"]
        for package in PACKAGES
        if package["name"] == canonicalize_name(requirement.name)
    )
    assert requirement.specifier.contains(version)


def test_requirements_lock_has_every_package():
    assert sorted(requirement.name for requirement in exported("requirements.lock")) == sorted(
        package["name"] for package in PACKAGES
    )


@pytest.mark.parametrize("name", EXPORTS)
def test_export_has_versions_and_hashes_of_uv_lock(name):
    files = {
        f"{package['name']}=={package['version']}": {
            file["hash"] for file in [*package.get("wheels", []), package.get("sdist")] if file
        }
        for package in PACKAGES
    }
    for requirement, hashes in exported(name).items():
        assert hashes
        assert hashes == files[f"{requirement.name}{requirement.specifier}"]


@pytest.mark.parametrize("name", ["uv.lock", *EXPORTS])
def test_locks_name_public_addresses_only(name):
    addresses = re.findall(r"\w+://[^\s\"']+", (ROOT / name).read_text())
    assert [address for address in addresses if not address.startswith(PUBLIC)] == []


@pytest.mark.parametrize("home", ["/proc", None])
def test_tools_need_no_home_to_write_to(home, tmp_path):
    """Nothing can be written to /proc, not even by root; what tools keep there stays in here."""
    home = tmp_path if home is None else home
    given = {k: v for k, v in os.environ.items() if k not in ("XDG_CACHE_HOME", "MPLCONFIGDIR")}
    shown = subprocess.run(
        ["make", "-s", "--eval", 'show: ; @echo "$$XDG_CACHE_HOME,$$MPLCONFIGDIR"', "show"],
        cwd=ROOT, env={**given, "HOME": str(home)}, capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    assert shown == ("," if home == tmp_path else f"{ROOT}/.cache,{ROOT}/.cache/matplotlib")

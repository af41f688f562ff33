"""A release: version, changelog, citation and tag agree."""

import re
import subprocess
import tomllib

import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
RELEASES = re.findall(
    r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", (ROOT / "CHANGELOG.md").read_text(), re.M
)


def test_version_changelog_citation_and_lock_agree():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    locked = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    version, date = RELEASES[0]
    assert PROJECT["version"] == version == citation["version"]
    assert citation["date-released"].isoformat() == date
    assert version in {p["version"] for p in locked if p["name"] == "accelstudy"}
    assert citation["license"] == PROJECT["license"]


def test_a_tag_of_this_commit_is_that_of_its_version():
    tags = subprocess.run(
        ["git", "tag", "--points-at", "HEAD"], cwd=ROOT, capture_output=True, text=True
    ).stdout.split()
    assert {tag for tag in tags if tag.startswith("v")} <= {f"v{PROJECT['version']}"}


def test_python_versions_are_the_same_everywhere():
    named = {c.rpartition(" ")[2] for c in PROJECT["classifiers"] if "Python :: 3." in c}
    tested = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
    assert named == {*tested["jobs"]["test"]["strategy"]["matrix"]["python"]}
    assert (
        PROJECT["requires-python"]
        == f">={min(named)},<3.{max(map(int, (n[2:] for n in named))) + 1}"
    )


def test_the_environment_file_names_this_version():
    content = yaml.safe_load((ROOT / "workflow" / "envs" / "accelstudy.yaml").read_text())
    python, pip, packages = content["dependencies"]
    requirement = Requirement(packages["pip"][0])
    assert [requirement.name, pip] == ["accelstudy", "pip"]
    assert requirement.extras <= PROJECT["optional-dependencies"].keys()
    assert str(requirement.specifier) == f"=={PROJECT['version']}"
    assert f"{python.partition('=')[2]}.0" in SpecifierSet(PROJECT["requires-python"])


def test_each_page_that_the_readme_names_can_be_clicked():
    text = re.sub(r"```.*?```", "", (ROOT / "README.md").read_text("utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", text)
    assert len(links) > 15
    assert [link for link in links if not (ROOT / link).exists()] == []
    assert re.findall(r"`[^`]*\.md`", text) == []

"""What the package asks for is pinned, so that make installs the same everywhere."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).resolve().parents[2]


def name_of(requirement: str) -> str:
    found = re.match(r"[A-Za-z0-9._-]+", requirement)
    assert found, requirement
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {name_of(name): version for name, version in pairs}


def test_every_requirement_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    asked = list(project["project"]["dependencies"]) + project["build-system"]["requires"]
    for extra in project["project"]["optional-dependencies"].values():
        asked += extra
    assert {name_of(word) for word in asked} <= set(pins())


def test_what_is_pinned_serves_the_python_of_debian_12() -> None:
    """One package asked for 3.11.5: `make docs` failed there, and so did `make test`."""
    pinned = pins()
    found = [each for each in metadata.distributions()
             if pinned.get(name_of(each.metadata["Name"])) == each.version]  # fmt: skip
    assert found
    for each in found:
        asks = str(each.metadata.json.get("requires_python", ""))
        assert SpecifierSet(asks).contains("3.11.2"), f"{each.metadata['Name']} asks for {asks}"

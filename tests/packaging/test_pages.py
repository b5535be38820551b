"""What a stranger copies from a page works."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import setae

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "docs/start.md")


@pytest.mark.parametrize("page", PAGES)
def test_the_example_runs(page: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = re.search(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert found, f"{page} has no example"
    exec(compile(found[1], page, "exec"), {})
    assert capsys.readouterr().out.endswith("touched nothing\n")


def links(page: Path) -> list[str]:
    return re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text())


@pytest.mark.parametrize(
    "page",
    sorted(path.relative_to(ROOT) for path in [*ROOT.glob("*.md"), *ROOT.glob("*/README.md")]),
    ids=str,
)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(ROOT / page):
        if "://" not in link:
            assert (ROOT / page.parent / link).exists(), f"{page}: {link}"


def test_every_top_folder_says_what_it_holds() -> None:
    folders = [
        path
        for path in ROOT.iterdir()
        if path.is_dir() and not path.name.startswith(".") and path.name not in ("build", "runs")
    ]
    without = [folder.name for folder in folders if not (folder / "README.md").exists()]
    assert not without


def test_the_changelog_knows_this_version() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    assert f"## [{setae.__version__}]" in text or "## [Unreleased]" in text

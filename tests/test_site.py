"""The documentation site: its first page, its list of pages, and a build that fails at any warning."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
CONFIG = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
PAGES = {path.name for path in (ROOT / "docs").glob("*.md")}

mkdocs = pytest.mark.skipif(
    importlib.util.find_spec("material") is None, reason="mkdocs-material is not installed: make docs-tools"
)


def hook() -> ModuleType:
    spec = importlib.util.spec_from_file_location("site_index", ROOT / CONFIG["hooks"][0])
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_first_page_is_the_readme_and_links_to_pages_of_the_site() -> None:
    page = hook().index_page((ROOT / "README.md").read_text("utf-8"))
    links = {link.split("#")[0] for link in re.findall(r"\]\((?!https?:|#)([^)]+)\)", page)}
    assert len(links & PAGES) > 15
    assert [link for link in links if not (ROOT / "docs" / link).is_file()] == []
    assert "[docs/design.md](design.md)" in page and "LICENSE" in page


def test_only_links_out_of_the_documentation_lose_their_targets() -> None:
    made = hook().index_page("[a](docs/b.md#c) [L](LICENSE) [e](https://e.org/f.md) [s](#t) ![p](docs/p.png)")
    assert made == "[a](b.md#c) L [e](https://e.org/f.md) [s](#t) ![p](p.png)"


def named(entry: Any) -> list[str]:
    """Return the pages of a part of the list of pages."""
    if isinstance(entry, str):
        return [entry]
    values = entry.values() if isinstance(entry, dict) else entry
    return [name for value in values for name in named(value)]


def test_every_page_is_in_the_list_once() -> None:
    assert sorted(named(CONFIG["nav"])) == sorted({*PAGES, "index.md"})


def test_nothing_is_loaded_from_another_site() -> None:
    assert CONFIG["theme"]["font"] is False
    assert not {"extra_javascript", "extra_css"} & CONFIG.keys()


def test_make_builds_it_strictly_and_not_quietly() -> None:
    """With --quiet, mkdocs 1.6 counts no warnings: --strict would accept anything."""
    (line,) = re.findall(r"mkdocs build.*", (ROOT / "Makefile").read_text())
    assert "--strict" in line and not {"--quiet", "-q"} & set(line.split())


def build(site: Path, *options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--site-dir",
            site,
            *map(str, options),
        ],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )


@pytest.mark.campaign
@mkdocs
def test_the_site_is_made_without_a_warning(tmp_path: Path) -> None:
    done = build(tmp_path / "site")
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stdout + done.stderr
    made = {path.parent.name for path in (tmp_path / "site").glob("*/index.html")}
    assert {page.removesuffix(".md") for page in PAGES} <= made
    assert "<h1" in (tmp_path / "site" / "index.html").read_text("utf-8")


@pytest.mark.campaign
@mkdocs
def test_links_that_lead_nowhere_fail_the_site(tmp_path: Path) -> None:
    """A page that is not there, and a heading that is not on its page."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("*.gif", "__pycache__"))
    with (tmp_path / "docs" / "ci.md").open("a", encoding="utf-8") as page:
        page.write("\n[a](nowhere.md) [b](job.md#no-such-heading)\n")
    config = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    config |= {"docs_dir": str(tmp_path / "docs"), "hooks": [str(ROOT / CONFIG["hooks"][0])]}
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(config))
    done = build(tmp_path / "site", "--config-file", tmp_path / "mkdocs.yml")
    assert done.returncode == 1
    for target in ("nowhere.md", "no-such-heading"):
        assert re.search(rf"WARNING.*'ci.md'.*{target}", done.stderr), done.stderr

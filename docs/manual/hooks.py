"""What mkdocs does besides setting the pages: equations, and the examples as files beside the page about them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

import equations  # noqa: E402

WITH_EQUATIONS = {"theory.md", "zones.md", "accuracy.md", "extend.md"}


def on_files(files: Files, config: Any) -> Files:
    """The scenes of examples/ belong to the site: pages link to them as ../examples/..., as in the repository."""
    for path in sorted((ROOT / "examples").glob("*.*")):
        files.append(File.generated(config, f"examples/{path.name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    name = page.file.src_uri
    markdown = markdown.replace("](../examples/", "](examples/")
    return equations.page(markdown, "theory.md" if name != "theory.md" else "") if name in WITH_EQUATIONS else markdown

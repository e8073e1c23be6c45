"""What mkdocs does besides setting the pages: equations, names of pages in links, the examples as files beside them."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

HERE = Path(__file__).parent
DOCS, ROOT = HERE.parent, HERE.parents[1]
sys.path.insert(0, str(HERE))

import equations  # noqa: E402

WITH_EQUATIONS = {"theory.md", "zones.md", "zone_rules.md", "errors.md", "extend.md"}
KINDS = {".yaml", ".py", ".csv", ".txt"}  # of files of examples/; results that a reader has made there are no part
# Tables that need the room of a list of contents.
WIDE = {f"evidence/{name}.md" for name in ("validation", "extremes", "trade", "levels")}
# In docstrings: a parameter, or several, and what it is, at the beginning of a paragraph or after a sentence.
PARAMETER = re.compile(r"(<p>|[.;]\s+)((?:[a-z_]+,\s+)*[a-z_]+):\s+(?=\S)")
SHIM = "https://unpkg.com/iframe-worker/shim"  # which the plugin `offline` asks of another host
NAMED = re.compile(r"\[(?:docs/)?(\w+\.md)\]\(")


def on_files(files: Files, config: Any) -> Files:
    """The scenes of examples/ belong to the site: pages link to them as ../examples/..., as in the repository."""
    for path in sorted(x for x in (ROOT / "examples").iterdir() if x.is_file() and x.suffix in KINDS):
        files.append(File.generated(config, f"examples/{path.name}", abs_src_path=str(path)))
    return files


def title(name: str) -> str:
    """What a page is called where it is linked to by its file: its heading, as far as a colon."""
    page = next(DOCS / folder / name for folder in ("", "evidence", "howto") if (DOCS / folder / name).exists())
    heading = page.read_text(encoding="utf-8").partition("\n")[0]
    return heading.lstrip("# ").partition(":")[0]


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    name = page.file.src_uri
    if name in WIDE:
        page.meta |= {"hide": ["toc"], "search": {"boost": 0.2}}
    up = "../" * name.count("/")  # to the root of the site, which has no folder `docs`
    markdown = markdown.replace(f"]({up}../examples/", f"]({up}examples/")
    markdown = NAMED.sub(lambda m: f"[{title(m[1])}](", markdown)
    return equations.page(markdown, "theory.md" if name != "theory.md" else "") if name in WITH_EQUATIONS else markdown


def on_page_content(html: str, page: Any, **_: Any) -> str:
    """Docstrings are free text: each parameter gets a line of its own."""
    if page.file.src_uri != "api.md":
        return html
    begin = html.index("doc-contents")
    return html[:begin] + PARAMETER.sub(_parameter, html[begin:])


def on_post_page(output: str, **_: Any) -> str:
    """Search works where pages are opened from a folder: the worker that it needs there comes from the site itself."""
    return output.replace(SHIM, "manual/iframe-worker.js")


def on_post_template(output_content: str, **_: Any) -> str:
    """Of pages that are no Markdown, such as 404.html, the same."""
    return output_content.replace(SHIM, "manual/iframe-worker.js")


def _parameter(found: re.Match[str]) -> str:
    return f"{found[1]}{'' if found[1] == '<p>' else '<br>'}<code>{found[2]}</code>: "

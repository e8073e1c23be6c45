"""Run the commands of how-tos and keep the pictures that they write for docs/pictures.

    python docs/figures/howto_pictures.py [name ...]      # of docs/howto; without a name: all

A page saves its scenes by the comment in their first line, `# buoy.yaml`; its picture `howto_buoy.png` is the file
`buoy.png` that its commands write.
"""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"


def draw(page: Path) -> None:
    """Run every block of a page in an empty folder, and store its pictures."""
    shrink = runpy.run_path(str(ROOT / "docs" / "figures" / "make_pictures.py"))["shrink"]
    text = page.read_text(encoding="utf-8")
    here = os.environ | {"PYTHONPATH": str(ROOT)}
    here["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    with tempfile.TemporaryDirectory() as folder:
        for language, block in re.findall(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
            name = re.match(r"# (\w+\.yaml)\n", block)
            if language == "yaml" and name:
                Path(folder, name[1]).write_text(block, encoding="utf-8")
            if language == "bash":
                subprocess.run(["bash", "-euo", "pipefail", "-c", block], cwd=folder, env=here, check=True)
        for name in sorted(set(re.findall(r"\]\(\.\./pictures/howto_(\w+)\.png\)", text))):
            shrink(Path(folder, f"{name}.png").read_bytes(), PICTURES / f"howto_{name}.png")


if __name__ == "__main__":
    pages = sorted((ROOT / "docs" / "howto").glob("*.md"))
    for page in pages:
        if page.stem in (sys.argv[1:] or [page.stem]):
            draw(page)

"""docs/export.md does what it says: its commands and its Python run, in order, beside the result they name."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import hybrid
from hybrid.cli.commands import main

ROOT = Path(hybrid.__file__).parents[1]
PAGE = ROOT / "docs" / "export.md"


@pytest.mark.long
@pytest.mark.needs("xarray", "h5netcdf", "netCDF4", "pandas", "vtk", "rainflow")
def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    hybrid.run(hybrid.load_scene(ROOT / "examples" / "02_suspension.yaml"), tmp_path / "02_suspension.h5").close()
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    names: dict[str, object] = {}
    for language, block in blocks:
        if language == "bash":
            for line in block.splitlines():
                words = shlex.split(line, comments=True)
                assert words[0] == "hybrid" or line.startswith("pip install "), line
                if words[0] == "hybrid":
                    with pytest.raises(SystemExit) as left:
                        main(words[1:])
                    assert not left.value.code, f"{line}: {capsys.readouterr().err}"
        elif language == "python":
            capsys.readouterr()
            exec(compile(block, PAGE.name, "exec"), names)
            said = capsys.readouterr().out.splitlines()
            assert said == re.findall(r"print\(.*\)  # (.*)$", block, re.MULTILINE), "as the comments beside it say"
    assert {language for language, _ in blocks} >= {"bash", "python"}
    made = {file.name for file in tmp_path.iterdir()}
    assert {"02_suspension.nc", "02_suspension.csv", "02_suspension.vtkhdf", "02_suspension.cycles.csv"} <= made

"""Commands as tests call them: in a folder of their own, with what they say."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest


class Said(NamedTuple):
    """How a command ended, and what it said on which stream."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[dict]:
        """Its lines of JSON."""
        return [json.loads(line) for line in self.out.splitlines()]


Call = Callable[..., Said]


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run a command in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> Said:
        from hybrid.cli.commands import main

        capsys.readouterr()
        with pytest.raises(SystemExit) as leaving:
            main(list(arguments))
        return Said(int(leaving.value.code or 0), *capsys.readouterr())

    return run

"""Packages that tests need beside pytest: where one is not installed the test skips by the name of its extra.

A test, a class or a file is marked `@pytest.mark.needs("xarray")`, which conftest.py reads.  With HYBRID_TEST_EXTRAS=all,
as in CI once `dev` is installed, what would skip fails.
"""

from __future__ import annotations

import os
import re
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]


def name_of(requirement: str) -> str:
    """The package of a requirement."""
    return re.split(r"[\[<>=,;]", requirement)[0]


def extra_of(package: str) -> str:
    """The first extra in pyproject.toml that brings a package."""
    return next(extra for extra, needed in EXTRAS.items() if package in map(name_of, needed))


def skip_without(*packages: str, whole_file: bool = False) -> None:
    """Skip, or fail where all extras are promised, where one of these packages is not installed."""
    for package in packages:
        try:
            distribution(package)
        except PackageNotFoundError:
            extra = extra_of(package)
            text = f'needs {package} of the extra `{extra}`: pip install -e ".[{extra}]"'
            if os.environ.get("HYBRID_TEST_EXTRAS") == "all":
                pytest.fail(text, pytrace=False)
            pytest.skip(text, allow_module_level=whole_file)


def of_file(*packages: str) -> pytest.MarkDecorator:
    """The mark of a file that imports packages at its head: `pytestmark = extras.of_file("fmpy")`."""
    skip_without(*packages, whole_file=True)
    return pytest.mark.needs(*packages)

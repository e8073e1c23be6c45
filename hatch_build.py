"""What a wheel says of the machine code in it: the platform and Python it is for, and the numba it was made with."""

from __future__ import annotations

import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# Of the C library the code calls mathematical functions that are older than this.
MANYLINUX = "manylinux_2_17"


class Hook(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """A wheel without machine code stays one for any platform."""
        compiled = Path(self.root, "hybrid", "kernels", "compiled")
        if version != "standard" or not any(compiled.rglob("*.kernel")):
            return
        python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        if platform.startswith("linux_"):
            platform = platform.replace("linux", MANYLINUX, 1)
        build_data["pure_python"] = False
        build_data["tag"] = f"{python}-{python}{getattr(sys, 'abiflags', '')}-{platform}"
        build_data["dependencies"] = (compiled / "needs.txt").read_text(encoding="utf-8").split()

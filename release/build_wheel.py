"""Build a wheel with machine code of the kernels for this platform, Python and numba: `python release/build_wheel.py`.

For each level of processors (kernels.machine.cache) that this one can execute: what tests/compile_kernels.py lists, and
what the examples call.  From nothing this takes ten minutes of processor time; compiled code is kept in --cache, from
which a second wheel of the same kernels is made in two minutes.  `pip wheel --no-deps .` builds one without.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from hybrid.kernels.machine import cache  # noqa: E402
from hybrid.kernels.machine.cache import SUFFIX  # noqa: E402

SUSPENSION = ROOT / "examples" / "02_suspension.yaml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="folder for the wheel (dist)")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "kernels", help="folder of compiled code")
    parser.add_argument("--few", action="store_true", help="only what the suspension of the examples calls: a minute")
    asked = parser.parse_args()
    has = set(cache.processor().features.split(","))
    levels = [x for x in cache.LEVELS if has >= {f"+{y}" for y in x.features}]
    if not levels:
        raise SystemExit(f"this processor executes none of {', '.join(x.name for x in cache.LEVELS)}")
    shutil.rmtree(cache.SHIPPED, ignore_errors=True)
    try:
        for level in levels:
            compile_for(level, asked.few, asked.cache.resolve())
        needs = [f"{name}=={version(name)}\n" for name in ("numba", "llvmlite")]
        (cache.SHIPPED / cache.NEEDS).write_text("".join(needs), encoding="utf-8")
        build = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(asked.output), str(ROOT)]
        subprocess.run(build, check=True)
    finally:
        shutil.rmtree(cache.SHIPPED, ignore_errors=True)  # this checkout goes on with code for its own processor
    for wheel in asked.output.glob(f"hybrid_cable-*-cp{sys.version_info[0]}{sys.version_info[1]}-*.whl"):
        print(f"{wheel}: {wheel.stat().st_size / 1e6:.1f} MB")


def compile_for(level: cache.Level, few: bool, kept: Path) -> None:
    """Put the code for a level into the package."""
    settings = {"NUMBA_CPU_NAME": level.name, "NUMBA_CPU_FEATURES": cache.features_of(level)}
    environment = os.environ | settings | {"HYBRID_CACHE_DIR": str(kept), "PYTHONPATH": str(ROOT)}
    if not few:
        script = str(ROOT / "tests" / "compile_kernels.py")
        halves = [subprocess.Popen([sys.executable, script, half], env=environment) for half in ("solvers", "rest")]
        if any([half.wait() for half in halves]):
            raise SystemExit("tests/compile_kernels.py failed")
    with TemporaryDirectory() as work:
        contact = SUSPENSION.parent / "contact"
        for scene in [SUSPENSION] if few else sorted([*SUSPENSION.parent.glob("*.yaml"), *contact.glob("*.yaml")]):
            command = [sys.executable, "-m", "hybrid", "run", str(scene), "-q", "-o", f"{work}/run.h5"]
            subprocess.run(command, env=environment, check=True)
    place = cache.Place(cache.folder_of(level.name), cache.processor_of(level), ours=False)
    place.folder.mkdir(parents=True)
    files = list(kept.rglob(f"*-{place.mark}-*{SUFFIX}"))
    for file in files:
        shutil.copyfile(file, place.folder / file.name)
    size = sum(file.stat().st_size for file in files)
    print(f"{place.folder.name}: {len(files)} kernels, {size / 1e6:.1f} MB", flush=True)


if __name__ == "__main__":
    main()

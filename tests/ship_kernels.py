"""Put machine code of the kernels into the package, as a release does: `python tests/ship_kernels.py [--few]`.

For each level of processors (kernels.machine.cache) that this one can execute: what tests/compile_kernels.py lists, and what
the examples call, compiled from an empty cache and copied to hybrid/kernels/compiled/.  Everything takes about eight
minutes of processor time; --few: only what the suspension of the examples calls, in one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from hybrid.kernels.machine import cache
from hybrid.kernels.machine.code_file import SUFFIX

ROOT = Path(__file__).parents[1]
SUSPENSION = ROOT / "examples" / "02_suspension.yaml"


def main(few: bool) -> None:
    has = set(cache.processor().features.split(","))
    for level in cache.LEVELS:
        if has >= {f"+{x}" for x in level.features}:
            ship(level, few)


def ship(level: cache.Level, few: bool) -> None:
    with TemporaryDirectory() as work:
        settings = {"NUMBA_CPU_NAME": level.name, "NUMBA_CPU_FEATURES": cache.features_of(level)}
        environment = os.environ | settings | {"HYBRID_CACHE_DIR": f"{work}/cache"}
        package = str(Path(cache.__file__).parents[2])
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
        scenes = [SUSPENSION] if few else sorted(x for x in SUSPENSION.parent.glob("*.yaml") if is_scene(x))
        if not few:
            script = str(Path(__file__).with_name("compile_kernels.py"))
            halves = [subprocess.Popen([sys.executable, script, half], env=environment) for half in ("plane", "space")]
            if any([half.wait() for half in halves]):
                raise SystemExit("tests/compile_kernels.py failed")
        for scene in scenes:
            command = [sys.executable, "-m", "hybrid", "run", str(scene), "-q", "-o", f"{work}/run.h5"]
            subprocess.run(command, env=environment, check=True)
        folder = cache.folder_of(level.name)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        files = list(Path(work, "cache").rglob(f"*{SUFFIX}"))
        for file in files:
            shutil.copyfile(file, folder / file.name)
    size = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{folder}: {len(files)} kernels, {size / 1e6:.1f} MB")


def is_scene(file: Path) -> bool:
    """Whether a file is a scene, not a study of several or a table."""
    import hybrid

    try:
        hybrid.load_scene(file)
    except hybrid.SceneError:
        try:
            hybrid.load_system(file)
        except hybrid.SceneError:
            return False
    return True


if __name__ == "__main__":
    main("--few" in sys.argv[1:])

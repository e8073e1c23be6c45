"""Write a scene as a co-simulation unit (FMU, FMI 3.0): `export_fmu("scene.yaml", "line.fmu")`.

The unit holds the scene and the files that it names, and asks the interpreter that runs it for hybrid
(`needsExecutionTool`); `hybrid.couple.fmu_unit` is what runs in it.  pythonfmu3 makes the container.
"""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.scene.base import places_of_files
from hybrid.scene.read import SceneLike, as_scene, scene_text
from hybrid.scene.root import Scene
from hybrid.simulation.stepping import Simulation
from hybrid.store.reader import check_target, write_atomically

# In the folder `resources` of the unit.
SCENE, INTERFACE = "scene.yaml", "interface.json"
# What a unit can do, beside what pythonfmu3 says of it.
ABILITIES = {
    "canGetAndSetFMUState": True,
    "canSerializeFMUState": False,
    "canHandleVariableCommunicationStepSize": True,
    "needsExecutionTool": True,
}


def export_fmu(scene: SceneLike, path: str | Path, *, name: str | None = None, overwrite: bool = True) -> Path:
    """Write a scene as a co-simulation unit (FMI 3.0) and return its path.

    scene: as of `hybrid.Simulation`; it is built once, so that a unit that cannot start is not written.  path: the
    file, ending in .fmu.  name: of the model, else that of the file.  SceneError and ComputationError as of
    `hybrid.Simulation`; ResultError when pythonfmu3 is missing or the file cannot be written.
    """
    target = Path(path).expanduser().resolve()
    if target.suffix.lower() != ".fmu":
        raise ResultError(f"{target}: expected a name that ends in .fmu\n    try:      {target.with_suffix('.fmu')}")
    check_target(target, overwrite)
    builder = optional_package("pythonfmu3.builder", "an FMU", "fmu").FmuBuilder
    found = as_scene(scene)
    model = re.sub(r"\W", "_", name or target.stem)
    if not model[:1].isalpha():
        model = f"cable_{model}"
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as room:
        folder = Path(room)
        files = _write_scene(found, folder)
        interface = _interface(found) | {"name": model}
        text = json.dumps(interface, indent=1)
        (folder / INTERFACE).write_text(text, encoding="utf-8")
        # a module of its own for each unit: several may run in one interpreter
        token = hashlib.sha256((text + (folder / SCENE).read_text(encoding="utf-8")).encode()).hexdigest()[:16]
        script = folder / f"hybrid_{model}_{token}.py"
        script.write_text(_SCRIPT.format(model=model), encoding="utf-8")
        made = builder.build_FMU(script, folder / "made", [folder / SCENE, folder / INTERFACE, *files], **ABILITIES)
        write_atomically({target: made.read_bytes()}, overwrite)
    return target


_SCRIPT = '''"""A scene of hybrid as a co-simulation unit; made by `hybrid export`."""

from pythonfmu3 import Fmi3Slave

from hybrid.couple.fmu_unit import SceneUnit


class {model}(SceneUnit, Fmi3Slave):
    pass
'''


def _write_scene(scene: Scene, folder: Path) -> list[Path]:
    """The scene in `folder`, and copies there of the files that it names."""
    data, copies = scene.model_dump(mode="json", exclude_none=True), dict[str, Path]()

    for table, key, path in places_of_files(data):
        if path not in copies:
            copies[path] = folder / f"file{len(copies) + 1}{Path(path).suffix}"
            copies[path].write_bytes(Path(path).read_bytes())
        table[key] = copies[path].name
    text = scene_text(scene) if not copies else json.dumps(data, indent=1)  # JSON is YAML 1.2
    (folder / SCENE).write_text(text, encoding="utf-8")
    return list(copies.values())


def _interface(scene: Scene) -> dict[str, Any]:
    """What may be set of the ends or points, and where they begin."""
    with Simulation(scene) as made:
        points = {
            name: {
                "settable": sorted(made.settable(name)),
                "position": np.round(made.point(name).position, 12).tolist(),
            }
            for name in scene.points
        }
        lines = {}
        for name, line in scene.asked_scenes.items():
            payout = next(filter(None, (getattr(end, "payout", None) for end in line.ends.both)), None)
            lines[name] = {"payout": payout is not None, "winch": payout is not None and payout.from_outside}
        time = scene.require_time()
        return {"step": time.step, "duration": time.duration, "points": points, "lines": lines}

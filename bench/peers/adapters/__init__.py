"""Other cable programs on a scene of ours: an adapter for each, which runs in a process of its own.

    CableDyn   finite elements, implicit                      decks.py
    MoorDyn    lumped masses, explicit                        decks.py
    Exudyn     planar cable elements (ANCF), implicit         ancf.py

All of them compute a uniform line between two points, fixed or moved, in still water, on a level seabed; `unsupported`
says why a scene is anything else.  A new one is a class like these and a row in PEERS; what it alone cannot do it raises
as PeerFailed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import numpy as np

from hybrid.scene.ends import Pinned
from hybrid.scene.read import scene_text
from hybrid.scene.root import Scene
from peers.adapters.ancf import Exudyn
from peers.adapters.decks import CableDyn, MoorDyn
from peers.adapters.interface import Peer, PeerFailed, PeerResult, PeerRun

BENCH = Path(__file__).parents[2]
UNSUPPORTED = "unsupported"
TIME_LIMIT = 900.0  # s of wall time for one run
PEERS: Mapping[str, Peer] = {"CableDyn": CableDyn(), "MoorDyn": MoorDyn(), "Exudyn": Exudyn()}


def unsupported(scene: Scene) -> str:
    """Why other codes cannot do a scene; "" if they can."""
    if scene.initial.kind != "equilibrium":
        return f"the cable starts {scene.initial.kind}, not in equilibrium"
    if len(scene.cable.sections) > 1:
        return "the cable has more than one section"
    if scene.cable.attachments:
        return "something is attached to the cable"
    section = scene.cable.sections[0].model_dump(exclude_none=True)
    known = {"length", "mass", "diameter", "axial_stiffness", "bending_stiffness", "torsional_stiffness", "drag"}
    other = sorted(set(section) - known - {"added_mass", "rotary_inertia", "max_strain"})
    if other:
        return f"the section has {', '.join(other)}"
    if "axial_stiffness" not in section or "diameter" not in section:
        return "the cable is inextensible, or has no diameter"
    if isinstance(section.get("bending_stiffness"), tuple) or section.get("added_mass", {}).get("tangential"):
        return "the cable bends differently in two directions, or has added mass along it"
    if not all(isinstance(end, Pinned) for end in (scene.ends.start, scene.ends.end)):
        return "an end is not pinned"
    fluid, bed = scene.environment.fluid, scene.environment.seabed
    if fluid is None:
        return "there is no water"
    if fluid.waves is not None or fluid.flows():
        return "the water moves"
    if bed is not None and (bed.friction is not None or not bed.is_level):
        return "the seabed has friction or a slope"
    return ""


def peer_runs(scene: Scene) -> list[PeerRun]:
    """Runs of the codes that are installed; one each, with the reason, for a scene that they do not support."""
    installed = [code for code, peer in PEERS.items() if importlib.util.find_spec(peer.package) is not None]
    reason = unsupported(scene)
    if reason:
        return [PeerRun(code, PEERS[code].model, PEERS[code].package, unsupported=reason) for code in installed]
    return [
        PeerRun(code, PEERS[code].model, PEERS[code].package, *how)
        for code in installed
        for how in PEERS[code].settings
    ]


def versions(peer_runs: Sequence[PeerRun]) -> str:
    """Versions of the programs of these runs."""
    names = dict.fromkeys(peer_run.package for peer_run in peer_runs if not peer_run.unsupported)
    return ", ".join(f"{name} {version(name)}" for name in names)


def fingerprint(peer_run: PeerRun) -> str:
    """Hash of what decides the result besides the scene: these files, and the version of the program."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest() if peer_run.unsupported else f"{digest.hexdigest()} {versions([peer_run])}"


def compute(peer_run: PeerRun, scene: Scene) -> PeerResult:
    """Run it in a process of its own; PeerFailed if it fails or takes too long."""
    with tempfile.TemporaryDirectory() as folder:
        task = {"scene": scene_text(scene), "run": asdict(peer_run)}
        Path(folder, "task.json").write_text(json.dumps(task), encoding="utf-8")
        command = [sys.executable, "-m", "peers.adapters", folder]
        env = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(BENCH), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])
        }
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, env=env)
        except subprocess.TimeoutExpired:
            raise PeerFailed(f"not done after {TIME_LIMIT:g} s") from None
        if done.returncode:
            last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
            raise PeerFailed(last[:200])
        cost = json.loads(Path(folder, "cost.json").read_text(encoding="utf-8"))
        with np.load(Path(folder, "values.npz")) as file:
            return PeerResult({name: file[name] for name in file.files}, **cost)

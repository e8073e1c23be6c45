"""Checkpoints of a cable as hybrid-cable 1.0 and before kept them, as those of a run of one line.

Such a tree has no names of lines: the state of the line, its books and the clock of the steps stand beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.kernels.mesh.cell_errors import CURVATURE, QUANTITIES
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.failure import Weakness
from hybrid.model.layout import Layout
from hybrid.store.named_arrays import Tree, matched

FIRST_WORKS = 11  # works that were booked once
FIRST_REPORT = 34  # numbers that a report had once; later ones have more behind these
SAME_NODE = 1e-9  # of the length: round-off of the place of a node
# What the tree of a line calls names of the old one, and what that of the run does.
OF_LINE = {x: x for x in ("state", "rho", "work", "power", "envelope", "ends", "first_energy", "torsion")}
OF_LINE |= {"_stored": "stored", "watch": "noted", "first_places": "first_places", "first_turns": "first_turns"}
OF_RUN = {x: x for x in ("t", "steps", "changes", "cpu", "rho", "leg")} | {"dt": "last", "last": "interval"}
# What becomes something else, and what follows from the scene, or is of the last step alone.
TURNED_INTO_OTHERS = {"report", "tension", "twist", "control", "vibration", "lengths", "_turned", "_slackened", "mesh"}
TURNED_INTO_OTHERS |= {"self_contact", "zoning", "payout", "plane", "push", "home"}
LEFT_OUT = {"iterations", "floor", "_beyond", "correction"}


def is_of_cable(saved: Any) -> bool:
    """Whether a state, or a resolution, of a checkpoint is that of a cable, without a name of its line."""
    return isinstance(saved, Mapping) and ("mesh" in saved or "fineness" in saved)


def as_of_line(saved: Mapping[str, Any], name: str, model: Model, weaknesses: Sequence[Weakness]) -> dict[str, Any]:
    """The tree of a run of one line of this name; what a cable has none of is left out of it.

    model: of the line as the run begins; weaknesses: what may break. ValueError: it is of another line.
    """
    known = {*OF_LINE, *OF_RUN, *TURNED_INTO_OTHERS, *LEFT_OUT}
    if odd := [x for x in saved if x not in known]:
        raise ValueError(f"{', '.join(odd)}: not in the checkpoint of any cable")
    _check_mesh(saved["mesh"], model)
    line = {new: saved[old] for old, new in OF_LINE.items() if old in saved}
    line.setdefault("envelope", None)  # files of 0.6 have none, and no end had been let go in them
    line["ends"] = {"released": np.zeros(2, int)} | line["ends"]
    if not line.get("torsion"):
        line.pop("torsion", None)
    contact = saved.get("self_contact")
    if contact is not None:
        line["self_contact"] = contact
    if "report" in saved:  # not in a file of 0.6
        line["report"] = saved["report"][0]
        line["before"] = {"report": saved["report"][1], "tension": saved["tension"], "twist": saved["twist"]}
        line["before"]["touch"] = np.zeros((1, 0)) if contact is None else contact["touch"][None]
    found = _of_run(saved) | {"lines": {name: line}, "quantities": {}, "dry": [], "overlaps": [], "under": {}}
    found["broken"] = _broken(line["ends"]["released"], weaknesses)
    found["vibrations"] = {name: saved["vibration"]} if "vibration" in saved else {}
    found["zones"] = {} if saved["zoning"] is None else {name: _zones(saved)}
    found["planes"] = {name: {"plane": saved["plane"], "home": saved.get("home"), "push": _push(saved["push"])}}
    return found if saved.get("payout") is None else found | {"payout": {name: saved["payout"]}}


def _of_run(saved: Mapping[str, Any]) -> dict[str, Any]:
    """The clock of the steps, and what has been told of them."""
    found = {new: saved[old] for old, new in OF_RUN.items() if old in saved}
    if "report" not in saved:  # nor where steps to a stop began, nor anything of the step before
        found |= {"leg": [saved["t"], 0], "interval": 0.0}
    control = saved["control"]
    longest, *counted = saved.get("lengths", [0.0] * 7)
    told = [float(saved.get(key, False)) for key in ("_turned", "_slackened")]
    cuts = [*told, longest, 0.0, *(float(x) for x in counted)]
    steps = [] if control is None else [control["next"], control["before"], float(control["wary"])]
    return found | {"loaded": saved["t"], "control": steps, "cuts": cuts}


def _zones(saved: Mapping[str, Any]) -> dict[str, Any]:
    """Zones that move; those of a line that is paid out are of the cells that its winch has made."""
    cells = saved["mesh"] if saved.get("payout") is None else saved["payout"]
    return {"rod": cells["rod"], "here": cells.get("here"), "switching": saved["zoning"]}


def _push(saved: Any) -> Any:
    """A push out of the plane; a file of 0.6 does not say whether it was real, and none was."""
    return {"real": False} | saved if isinstance(saved, dict) else saved


def _broken(saved: Any, weaknesses: Sequence[Weakness]) -> list[int]:
    """Numbers of what may break, of the ends (2,) that had been let go."""
    released = matched(saved, np.zeros(2, int), "ends/released")
    if not np.isin(released, (0, 1)).all():
        raise ValueError(f"ends that are let go: {released}")
    found = {x.ends[0][1]: k for k, x in enumerate(weaknesses)}
    return [found[k] for k in np.flatnonzero(released).tolist()]


def _check_mesh(saved: Any, model: Model) -> None:
    """ValueError: the nodes, or the zones, of a checkpoint are not those of the model."""
    mine = mesh_tree(model)
    mesh = matched({"here": None} | dict(saved), dict.fromkeys({"here": None} | mine), "mesh")

    def same(a: Any, b: Floats) -> bool:
        return isinstance(a, np.ndarray) and a.shape == b.shape and bool((abs(a - b) <= SAME_NODE * model.length).all())

    if "s" in mine:
        fits = same(mesh["s"], mine["s"]) and mesh["zones"] == mine["zones"]
    else:
        fits = same(mesh["base"], mine["base"]) and np.array_equal(mesh["parts"], mine["parts"])
    if not fits:
        raise ValueError("nodes that are not those of the line")


def mesh_tree(model: Model) -> Tree:
    """Where the nodes of a model are, and its zones, for a checkpoint."""
    if model.layout is not None:
        return (model.layout if model.payout is None else model.payout.first_layout)._asdict()
    assert not isinstance(model.mesh, Layout)
    s, zones = model.mesh
    return {"s": s, "zones": [[x.kind, x.s_a, x.s_b] for x in zones]}


def of_line(saved: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """What a checkpoint has of a line, whatever it is worth."""
    lines = saved.get("lines")
    line = lines.get(name) if isinstance(lines, Mapping) else None
    return line if isinstance(line, Mapping) else {}


def zoning_of_today(saved: dict[str, Any]) -> dict[str, Any]:
    """The zones of a checkpoint, of an older version too: that had no cells that follow, or one largest curvature, or

    did not look at velocities, or said nothing of kinks.
    """
    saved = {"following": None} | saved
    following, manager, largest = saved["following"], saved.get("manager"), np.zeros(QUANTITIES)
    if isinstance(following, dict) and isinstance(following.get("peak"), float):
        largest[CURVATURE] = following["peak"]
        saved["following"] = {name: x for name, x in following.items() if name != "peak"}
    following = saved["following"]
    if isinstance(following, dict) and isinstance(following.get("calm"), np.ndarray):
        saved["following"] = {"waves": np.zeros(following["calm"].shape)} | following
    if isinstance(manager, dict):
        saved["manager"] = {"largest": largest, "fastest": 0.0, "kinked": False} | manager
    return saved

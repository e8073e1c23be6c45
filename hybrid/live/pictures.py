"""What a text of a scene comes to: its equilibrium as numbers to draw and what it would compute, or what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from hybrid.errors import Complaint, ComputationError, HybridError, SceneError
from hybrid.kernels.machine.compile import is_warm
from hybrid.live import drawing
from hybrid.model.model_costs import with_model
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import plan
from hybrid.model.resolution import model_is_free
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import located_in, read_text, scene_text
from hybrid.simulation.case_at_rest import CaseAtRest
from hybrid.simulation.first_use import compile_beside, kernels_of
from hybrid.simulation.network_run import static_system
from hybrid.store.array_contents import MemoryTarget
from hybrid.store.reader import Result, written_result

if TYPE_CHECKING:
    from hybrid.scene.root import Scene

# Points along a line in a picture: one for each cell, as far as a screen shows them apart.
LEAST_POINTS, MOST_POINTS = 101, 401


def picture_of(text: str, file: str, compiling: Callable[[], None]) -> tuple[dict[str, Any], Result | None]:
    """What the page shows for a text, and the result of its equilibrium.

    file: the name of the scene file, in whose folder motion files are looked for.  compiling: called before kernels
    are compiled, which takes long.  A refused text, or one without an equilibrium, has `problems` and no `frame`.
    """
    out: dict[str, Any] = {"problems": [], "notes": []}
    try:
        scene, renamed = read_text(text, file)
        out["notes"] = [{"line": key.line, "title": "renamed", "text": str(key)} for key in renamed]
        out["title"], out["moves"] = scene.title or "", scene.time is not None
        made = plan(scene)
        out["plan"] = _plan_rows(scene, made)
        _begin_to_compile(scene, compiling)
        result = equilibrium(scene, made)
    except SceneError as error:
        out["problems"] = [_refused(complaint) for complaint in located_in(error, text, file).complaints]
        return out, None
    except ComputationError as error:
        out["problems"] = [_failed(error, text, file)]
        return out, None
    except HybridError as error:
        out["problems"] = [{"line": None, "where": "scene", "text": str(error)}]
        return out, None
    points = LEAST_POINTS if len(result.lines) > 10 else MOST_POINTS
    out |= drawing.around(result)
    out |= {"heads": drawing.heads(result), "frame": drawing.frames(result, [0], points)[0]}
    return out | {"facts": drawing.facts(result)}, result


def equilibrium(scene: Scene, made: Any) -> Result:
    """The equilibrium with the cells of a first run: no coarser ones to estimate its error, no pre-run for its mesh.

    It is looked for as `hybrid static` does, from the scene alone: from the last picture Newton's method might find
    another one, where there are several.
    """
    target, at_rest = MemoryTarget(), _lines_at_rest if scene.line_names else _cable_at_rest
    at_rest(scene, made, target)
    return written_result(target)


def _lines_at_rest(scene: Any, made: Any, target: MemoryTarget) -> None:
    static_system(scene, target, partial(scene_text, scene))


def _cable_at_rest(scene: Any, made: Any, target: MemoryTarget) -> None:
    check_motions(scene)
    if model_is_free(scene, moves=False):
        scene = with_model(scene, "rod")
    if isinstance(scene.output.points, int):
        points = min(max(sum(made.cells) + 1, LEAST_POINTS), MOST_POINTS)
        output = scene.output.model_copy(update={"points": points, "errors": False})
        scene = scene.model_copy(update={"output": output})
    case = CaseAtRest(scene)
    case.record(NetworkResolution.of(case.lines), target)


def _begin_to_compile(scene: Scene, compiling: Callable[[], None]) -> None:
    """Begin to compile what an equilibrium calls, once on a machine; `compiling` hears of it beforehand."""
    if not is_warm(kernels_of(scene, True)):
        compiling()
        compile_beside(scene, static=True)


def _refused(complaint: Complaint) -> dict[str, Any]:
    """A complaint as the page shows it."""
    text = f"expected: {complaint.expected}" + (f"\ntry: {complaint.fix}" if complaint.fix else "")
    return {
        "line": complaint.line, "column": complaint.column, "where": complaint.where, "given": complaint.value,
        "text": text,
    }  # fmt: skip


def _failed(error: ComputationError, text: str, file: str) -> dict[str, Any]:
    """An equilibrium that was not found, at the line of `initial`, or of several lines at that of `lines`."""
    for where in ("initial", "lines"):
        place = located_in(SceneError([Complaint(where, "", "")]), text, file).complaints[0]
        if place.line is not None and text.splitlines()[place.line - 1].lstrip().startswith(f"{where}:"):
            break
    s = "" if error.s is None else f" (s = {error.s:.6g} m)"
    what = f"no equilibrium: {error.outcome.cause}{s}"
    detail = error.detail.strip().splitlines()
    remedy = str(error).splitlines()[-1].strip()
    lines = [*(f"detail: {x.strip()}" for x in detail[:1]), remedy]
    return {"line": place.line, "column": place.column, "where": "equilibrium", "given": what, "text": "\n".join(lines)}


def _plan_rows(scene: Any, made: Any) -> list[list[str]]:
    """What a run would compute, as rows of a name and a text."""
    if scene.line_names:
        rows = []
        for name, line in made.lines.items():
            kinds = ", ".join(dict.fromkeys(zone.kind for zone in line.zones))
            rows.append([f"line {name}", f"{kinds}, {sum(line.cells)} cells"])
        rows.append(["in all", f"{made.cells} cells, {made.unknowns} unknowns"])
    else:
        rows = _zone_rows(made)
        if model_is_free(scene):
            rows.insert(0, ["model", "the cheapest, by a pre-run: " + ", ".join(kind for kind, _ in made.choice)])
    if scene.time is None:
        rows.append(["time", "no motion (no table `time`)"])
    else:
        rows.append(["time", f"{scene.time.duration:.6g} s, {made.steps} steps; about {made.seconds:.2g} s to compute"])
    return rows


def _zone_rows(made: Any) -> list[list[str]]:
    cells = sum(made.cells)
    if made.base_cells is not None:
        rows = [["zones", "adaptive: rod where a criterion asks for it, catenary elsewhere"]]
        rows.append(["cells", f"{made.base_cells} as catenary, {cells} if all is rod ({made.unknowns} unknowns)"])
        return rows
    rows = [
        [zone.kind, f"s = {zone.s_a:.6g} to {zone.s_b:.6g} m, {n} cells"]
        for zone, n in list(zip(made.zones, made.cells, strict=True))[:6]
    ]
    if len(made.zones) > 6:
        rows.append(["..", f"and {len(made.zones) - 6} more zones"])
    rows.append(["cells", f"{cells} ({made.unknowns} unknowns)"])
    return rows

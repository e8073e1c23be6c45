"""Run `hybrid trade` on the example scenes and write docs/trade.md and its pictures.

    python docs/make_trade.py [-o FOLDER] [--levels] [--accuracies 3%,1%,0.3%] [--peers] [name ...]

Finished runs are stored in FOLDER (build/trade); a second call computes what is missing.  With names, only these
scenes are computed; the sections of the others stay.
"""

from __future__ import annotations

import argparse
import io
import runpy
import sys
from pathlib import Path

import hybrid
from hybrid.errors import HybridError
from hybrid.studies.runs import StudyProgress
from hybrid.studies.tradeoff import ACCURACIES
from hybrid.view.tradeoff import plot_trade

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "bench"))
from peers import trade  # noqa: E402  of the bench

PICTURES = ROOT / "docs" / "pictures"
SCENES = ("touchdown", "s_tether", "rov_tether", "laying", "slack_on_seabed")
PARTS = [part for name in SCENES for part in (name, f"{name}.levels")]
BEGIN, END = "<!-- {} -->\n", "<!-- end of {} -->\n"
HEAD = """\
# Error against cost

Use this page to choose model and accuracy by what they cost on your scene.
`hybrid trade scene.yaml` computes a scene with every model at several accuracies, compares errors with CPU time, and
recommends a setting.

<!-- not run in CI: all runs, and other programs, take minutes; the README runs a few -->
```bash
hybrid trade scene.yaml                      # a folder scene.trade with trade.md, trade.csv and trade.png
hybrid trade scene.yaml --for "3 cm"         # the cheapest setting for this accuracy
hybrid trade scene.yaml --models rod,adaptive --accuracies 3%,1% --repeat 3
```

Every run is compared with a rod everywhere, at an accuracy of 0.03 % (or a third of the finest accuracy of the study).
Its own error estimate and a run of the same model at three times its error show how converged it is.
Errors are the largest over all outputs and points (position) or over both ends (end force, as vectors); relative errors
are of the length of the cable and of the largest end force. "Estimate" is the error estimate of the run itself; the
factor in brackets is estimate / error (effectivity). CPU time is that of the process from the scene to the result, with
coarser runs for the error estimate, the mesh pre-run and statics; kernels are loaded beforehand.

A run is on the Pareto front if no other is both cheaper and more accurate (error of position or of end force, the
larger of the two relative to the accuracy). A run is "missed" if its error exceeds its accuracy by more than the error
of the reference, or if its own estimate does. The cheapest run that meets the accuracy is recommended.
CPU times of 0.1 s vary by a few per cent from call to call: `--repeat 3` takes the median of three.

A finished run is stored in the folder `runs`, under a hash of scene, model, accuracy and package: a second call
computes only the runs that are missing, for instance after Ctrl-C. In Python:

```python
import hybrid

scene = hybrid.load_scene("examples/s_tether.yaml", ["time.duration=6"])
table = hybrid.trade(scene, "s_tether.trade", models=["catenary", "rod"], accuracies=["10%"], target="10%")
print(table.recommendation)
print(table.recommended, table.front(), table.rows)
```

Other programs beside it are a bench: in the folder `bench` of the sources, `python -m peers.trade SCENE.yaml` does the
same and then runs those that are installed, in processes of their own (`bench/peers/adapters/` has one for each): a
uniform line between two points, fixed or moved, in still water, on a level seabed. Their CPU time includes statics.

## What each level costs

`hybrid trade scene.yaml --levels` (`hybrid.trade_levels`) compares models at three levels of demand:

| level | asked |
|---|---|
| A | position within 0.1 % of the length, end forces within 1 % of the largest |
| B | the same, and the largest bending moment of every output within 5 % of the largest of all |
| C | the same, and curvature at every point and output within 5 % of the largest |

Models are rods, catenaries, zones that move, and ("following") zones that move with rods whose cells follow the
curvature. Each run asks for the accuracy of its level, with moments and curvature at every point; it is compared with a
rod everywhere of a third of that error.
`python -m peers.trade SCENE.yaml --levels` adds other programs to level A: they give positions and end forces.
The folder gets levels.md and levels.csv.

The sections below were written by `python docs/make_trade.py` for example scenes.
"""


def levels(name: str, folder: Path) -> str:
    """What the levels of one scene cost."""
    command = f"python -m peers.trade ../examples/{name}.yaml --levels"
    path = ROOT / "examples" / f"{name}.yaml"
    return trade.trade_levels(path, folder / f"{name}.levels", command=command).markdown(level=2)


def section(name: str, folder: Path, accuracies: list[str], peers: bool) -> str:
    """Run one scene; its part of the page, and its picture."""

    def show(now: StudyProgress) -> None:
        if now.part == 0.0:
            print(f"{name}: {now.done} of {now.total}, {now.what}", file=sys.stderr, flush=True)

    program, where = ("python -m peers.trade", "../") if peers else ("hybrid trade", "")
    command = f"{program} {where}examples/{name}.yaml --accuracies {','.join(accuracies)}"
    compute = trade.trade if peers else hybrid.trade
    scene = hybrid.load_scene(ROOT / "examples" / f"{name}.yaml")
    try:
        table = compute(scene, folder / name, accuracies=accuracies, progress=show, command=command)
    except HybridError as error:
        return f"## {scene.title}\n\nNo table: {str(error).splitlines()[0]}\n\n"
    page = io.BytesIO()
    plot_trade(table).savefig(page, dpi=150)
    shrink = runpy.run_path(str(ROOT / "docs" / "figures" / "make_pictures.py"))["shrink"]
    shrink(page.getvalue(), PICTURES / f"trade_{name}.png")
    return table.markdown(f"pictures/trade_{name}.png", level=2)


def main() -> None:
    """Write the page."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "trade")
    ask.add_argument("--accuracies", default=",".join(ACCURACIES))
    ask.add_argument("--peers", action="store_true")
    ask.add_argument("--levels", action="store_true", help="of these scenes alone what the levels cost")
    ask.add_argument("names", nargs="*", default=SCENES)
    given = ask.parse_args()
    page = ROOT / "docs" / "trade.md"
    before = page.read_text(encoding="utf-8") if page.exists() else ""
    parts = {name: before.partition(BEGIN.format(name))[2].partition(END.format(name))[0] for name in PARTS}
    for name in given.names:
        if given.levels:
            parts[f"{name}.levels"] = levels(name, given.output)
        else:
            parts[name] = section(name, given.output, given.accuracies.split(","), given.peers)
        text = "".join(f"\n{BEGIN.format(n)}{part}{END.format(n)}" for n, part in parts.items() if part)
        page.write_text(HEAD + text, encoding="utf-8")


if __name__ == "__main__":
    main()

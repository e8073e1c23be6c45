"""Run `hybrid trade` on the example scenes and write docs/trade.md and its pictures.

    python docs/make_trade.py [-o FOLDER] [--accuracies 3%,1%,0.3%] [--peers] [name ...]

What is done is kept in FOLDER (build/trade), so that a second call does what is missing.  With names, only these
scenes are computed; the others keep what the folder has of them.
"""

from __future__ import annotations

import argparse
import io
import runpy
import sys
from pathlib import Path

import hybrid
from hybrid.errors import HybridError
from hybrid.studies.runs import Doing
from hybrid.studies.tradeoff import ACCURACIES
from hybrid.view.tradeoff import plot_trade

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
SCENES = ("touchdown", "s_tether", "rov_tether", "laying", "slack_on_seabed")
BEGIN, END = "<!-- {} -->\n", "<!-- end of {} -->\n"
HEAD = """\
# Error against cost

What is paid for accuracy, and with which model it costs least: `hybrid trade scene.yaml` runs a ladder of models and
accuracies on a scene and says which setting to take.

<!-- not run in CI: whole ladders, and other programs, take minutes; the README runs a short one -->
```bash
hybrid trade scene.yaml                      # a folder scene.trade with trade.md, trade.csv and trade.png
hybrid trade scene.yaml --for "3 cm"         # the cheapest setting for this accuracy
hybrid trade scene.yaml --models rod,adaptive --accuracies 3%,1% --repeat 3
hybrid trade scene.yaml --peers              # other programs as well, those that are installed and can do the scene
```

Every run is compared with a rod everywhere, at an accuracy of 0.03 % (or a third of the finest on the ladder). How
converged that is, its own error figure says, and a run of the same model that was asked for three times its error.
Errors are the largest over all outputs and points (position) or over both ends (pull, as vectors); parts are of the
length of the cable and of the largest pull. The estimate is the run's own, and in brackets how many times the error it
is. CPU time is that of the process from the scene to the result: coarser runs to compare with, the run that looks where
cells belong, and the search for the equilibrium included; the kernels were loaded beforehand.

On the front are runs than which no other is both cheaper and nearer to what is asked for, error of position or of pull,
whichever is the larger part. A run is "missed" if its error exceeds what it was asked for by more than the reference
may be wrong, or if it says itself that it did not get there. Of those that are near enough the cheapest is recommended.
Runs of a tenth of a second differ by a few per cent of CPU time from one call to the next: `--repeat 3` takes the
median of three.

A finished run is kept in the folder `runs`, under a hash of the scene, the model, the accuracy and the package: a
second call makes those that are missing, after Ctrl-C for instance. In Python:

```python
import hybrid

scene = hybrid.load_scene("examples/s_tether.yaml", ["time.duration=6"])
table = hybrid.trade(scene, "s_tether.trade", models=["catenary", "rod"], accuracies=["10%"], asked_for="10%")
print(table.recommendation)
print(table.recommended, table.front(), table.rows)
```

Other programs run in processes of their own (`hybrid/studies/peers/` has an adapter for each): a uniform line between
two points, held or moved, in still water, on a level seabed. Their CPU time includes their statics.

The sections below are the pages that the program has written for example scenes, by `python docs/make_trade.py`.
"""


def section(name: str, folder: Path, accuracies: list[str], peers: bool) -> str:
    """Run one scene; its part of the page, and its picture."""

    def told(doing: Doing) -> None:
        if doing.part == 0.0:
            print(f"{name}: {doing.done} of {doing.total}, {doing.what}", file=sys.stderr, flush=True)

    command = f"hybrid trade examples/{name}.yaml --accuracies {','.join(accuracies)}" + (" --peers" if peers else "")
    scene = hybrid.load_scene(ROOT / "examples" / f"{name}.yaml")
    try:
        table = hybrid.trade(scene, folder / name, accuracies=accuracies, peers=peers, told=told, command=command)
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
    ask.add_argument("names", nargs="*", default=SCENES)
    given = ask.parse_args()
    page = ROOT / "docs" / "trade.md"
    before = page.read_text(encoding="utf-8") if page.exists() else ""
    parts = {name: before.partition(BEGIN.format(name))[2].partition(END.format(name))[0] for name in SCENES}
    for name in given.names:
        parts[name] = section(name, given.output, given.accuracies.split(","), given.peers)
        text = "".join(f"\n{BEGIN.format(n)}{part}{END.format(n)}" for n, part in parts.items() if part)
        page.write_text(HEAD + text, encoding="utf-8")


if __name__ == "__main__":
    main()

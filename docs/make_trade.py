"""Run `hybrid trade` on the example scenes and write docs/evidence/trade.md, levels.md and their pictures.

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
from hybrid.view.several_runs import plot_trade

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "bench"))
from peers import trade  # noqa: E402  of the bench

PICTURES = ROOT / "docs" / "pictures"
SCENES = ("touchdown", "s_tether", "rov_tether", "laying", "slack_on_seabed")
EVIDENCE = ROOT / "docs" / "evidence"
BEGIN, END = "<!-- {} -->\n", "<!-- end of {} -->\n"
HEADS = {
    "trade": """\
# Error against cost, measured

Use this page to compare models, accuracies and other programs on five examples: error against CPU time.
`python docs/make_trade.py` wrote it, scene by scene, with the command below each table.
[trade.md](../trade.md) says how to read it and how to do the same with a scene of your own.
""",
    "levels": """\
# What each level of demand costs

Use this page to compare what position, bending moments and curvature cost on five examples.
`python docs/make_trade.py --levels` wrote it, scene by scene, with the command below each table.
[trade.md](../trade.md#what-each-level-costs) says what the levels ask for.
""",
}


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
    return table.markdown(f"../pictures/trade_{name}.png", level=2)


def main() -> None:
    """Write the page."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "trade")
    ask.add_argument("--accuracies", default=",".join(ACCURACIES))
    ask.add_argument("--peers", action="store_true")
    ask.add_argument("--levels", action="store_true", help="of these scenes alone what the levels cost")
    ask.add_argument("names", nargs="*", default=SCENES)
    given = ask.parse_args()
    kind = "levels" if given.levels else "trade"
    page = EVIDENCE / f"{kind}.md"
    before = page.read_text(encoding="utf-8") if page.exists() else ""
    parts = {name: before.partition(BEGIN.format(name))[2].partition(END.format(name))[0] for name in SCENES}
    for name in given.names:
        if given.levels:
            parts[name] = levels(name, given.output)
        else:
            parts[name] = section(name, given.output, given.accuracies.split(","), given.peers)
        text = "".join(f"\n{BEGIN.format(n)}{part}{END.format(n)}" for n, part in parts.items() if part)
        page.write_text(HEADS[kind] + text, encoding="utf-8")


if __name__ == "__main__":
    main()

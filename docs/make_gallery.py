"""Make the films of docs/films, and docs/gallery.md which shows them.

    python docs/make_gallery.py [name ...]      # computes these examples, or all, and writes their films and the page
    python docs/make_gallery.py --page          # the page alone

A film is that of `hybrid plot --animate`, on a smaller page so that its words can be read on a phone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import hybrid
from hybrid.view.matplotlib_backend import animate

ROOT = Path(__file__).parents[1]
FILMS, PAGE = ROOT / "docs" / "films", ROOT / "docs" / "gallery.md"
LARGEST = 400_000  # bytes of a film
# What each film shows, in the order of the page.
SHOWN = {
    "touchdown": "A mooring line heaves at its fairlead: the touchdown wanders, and the rod (orange) goes with it.",
    "s_tether": "A tether, heavy above and buoyant below, hangs in an S while its buoy heaves: rod in the bends.",
    "laying_loop": "A twisted cable is laid too slack: it throws a loop, which is pulled open again.",
    "plectoneme": "A twisted rod whose ends approach winds around itself: it touches itself and does not pass through.",
    "trefoil": "A trefoil knot is pulled tight: its loop closes, and friction in the braid carries the pull.",
    "tethers_tangle": "Two vehicles circle each other twice and back: their tethers wind up, and come apart.",
    "umbilical_clash": "A current drives an umbilical against a mooring line.",
    "rope_over_sheave": "A rope slips over a sheave that does not turn, as the lighter weight is let go.",
    "cable_over_pipeline": "A cable that is thrown over a pipeline sinks, comes down across it, and lies there.",
    "06_whip": "A rod that is clamped at one end is let go from the horizontal; its tip whips.",
}
HEAD = """\
# Gallery

Use this page to see what cables do, and to find the example that does something like yours.

Every film is a result of a scene of [examples](examples.md); orange is a rod, blue a catenary, and the band is the
range of the tension over all times.
Each was made by two commands, such as

```text
hybrid run examples/touchdown.yaml
hybrid plot --animate touchdown.h5
```

`python docs/make_gallery.py` makes all of them, and this page.

"""


def film(name: str, result: hybrid.Result) -> Path:
    """The film of a result, for this page."""
    FILMS.mkdir(exist_ok=True)
    made = animate(result, FILMS / f"{name}.mp4", width=4.4, overwrite=True)
    size = made.path.stat().st_size
    if size > LARGEST:
        raise RuntimeError(f"{made.path} has {size} bytes, more than {LARGEST}")
    return made.path


def example(name: str) -> Path:
    """The scene of this name."""
    return next((ROOT / "examples").rglob(f"{name}.yaml"))


def page() -> str:
    """The page, with the films that are there."""
    text = HEAD
    for name, words in SHOWN.items():
        title = example(name).read_text(encoding="utf-8")
        title = next(line.removeprefix("title: ") for line in title.splitlines() if line.startswith("title: "))
        text += f"## {title}\n\n{words}\n\n"
        # the poster is what phones show before a film is played
        text += f'<video controls loop muted playsinline preload="metadata" poster="pictures/{name}.png" '
        text += f'src="films/{name}.mp4"></video>\n\n'
        text += f"[{name}.yaml](../{example(name).relative_to(ROOT).as_posix()})\n\n"
    return text.rstrip("\n") + "\n"


def main(names: list[str]) -> None:
    for name in [] if "--page" in names else names or SHOWN:
        film(name, hybrid.run(example(name)))
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])

"""The board: the same problems for every program, against published values and closed forms.

    cd bench && python -m board [--problems NAME ...] [-o FOLDER]

It prints and writes docs/board.md and docs/pictures/board.png.  `references.json` holds statements and published values
with their sources; every other number is computed when the command is called.  A problem is a function of
`problems.py` or `against_peers.py`; it returns what each program found and what it cost.
"""

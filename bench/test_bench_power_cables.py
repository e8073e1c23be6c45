"""Equilibria of 123 power cables beside the catenaries between the same ends, and beside OrcaFlex.

    pytest bench/test_bench_power_cables.py -m bench -s -n 0

The cables are those of the statics matrix of CableDyn 0.3.0 (https://github.com/SMI-Lab-Inha/CableDyn, Apache-2.0):
lazy, steep and lazy S waves, hung lines, slopes, rough beds, currents, friction, clamps.  `power_cables.json` holds
their data.  Each is computed as an engineer would: the data, and nothing else given.  The tension at the start is
compared with the nearest catenary between the ends without bending (15 %, where sqrt(EI/T) is below a twentieth of the
length), or with the value of OrcaFlex (1 %).  Twins agree with what they are twins of: moved or turned to 1e-6, on a
finer mesh to 0.5 %, in a motion from rest to 1e-5 of the equilibrium on its mesh, with friction to that of what lies
on the bed.  A line that is too long for its span, or compressed, is refused or said.
"""

from __future__ import annotations

import numpy as np
import pytest
from power_cables import solve_all

pytestmark = pytest.mark.bench


def test_power_cables(capsys: pytest.CaptureFixture[str]) -> None:
    found = solve_all()
    admissible = [name for name, x in found.items() if x.admissible]
    wrong = [name for name in admissible if not found[name].good]
    silent = [name for name, x in found.items() if x.silent]
    off = [x.off for x in found.values() if x.judged_by_root]
    cpu = [x.answer.cpu for x in found.values()]
    lines = [
        f"{name:20s} {x.row['expect'][:12]:12s} {x.tension:12.1f} N {100 * x.off:7.2f} % twin {x.apart:8.1e} "
        f"{x.answer.cells:5d} cells {x.answer.cpu:6.2f} s  {x.answer.refused or ', '.join(x.answer.events)}"
        for name, x in found.items()
    ]
    solved = len(admissible) - len(wrong)
    with capsys.disabled():
        print("\n" + "\n".join(lines))
        print(f"{len(found)} cases: {solved} of {len(admissible)} admissible solved within the bounds; "
              f"{np.median(off) * 100:.2f} % off in the median, {max(off) * 100:.1f} % at most; "
              f"CPU {np.median(cpu):.2f} s in the median, {max(cpu):.1f} s at most")  # fmt: skip
        print(f"not within: {', '.join(wrong) or 'none'}; in compression without a word: {', '.join(silent) or 'none'}")
    assert not wrong

"""A vehicle that goes down to 1000 m on a tether and holds its place there: a controller drives winch and thrusters.

Shows:    `Simulation.set_payout` and `set_force` in every step: a winch and thrusters that follow a controller written
          in Python.
Physics:  the vehicle and the current of examples/rov_descent.yaml.  The winch pays out at 1 m/s and brings the vehicle
          to its depth in proportion to what is missing; thrusters of at most 1.5 kN hold it above its target
          against the current and the tether, in proportion to place and velocity, and to what is missing over time.
Look at:  without thrusters the vehicle hangs 42 m downstream; with them it stays within 0.1 m of its target, for 130 N
          of thrust in the mean.  Its depth is 1000.0 m in the mean, but it goes up and down by 1.5 m where the ship
          has 0.7 m: the tether passes the heave on, and tether and vehicle are near resonance.  The pull at the ship
          is 3.3 to 8.1 kN.
Run time: 7 s (12500 steps, 10 cells at the beginning, 199 at the end).
Source:   made for this package.

    python examples/11_rov_controller.py [picture.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import hybrid

RATE, SLOPE = 1.0, 0.05  # m/s, m/s2: what the winch does at most
WINCH = 0.05  # 1/s, rate of the winch per depth that is missing
PLACE, SPEED, DRIFT = 100.0, 500.0, 2.0  # N/m, N s/m, N/(m s): what the thrusters do per metre, m/s and metre second
THRUST = 1500.0  # N, of the thrusters at most


def main(picture: str | None = None, depth: float = 1000.0, hold: float = 300.0) -> tuple[float, float]:
    """Largest distance (m) from the target across and mean error of depth (m), in the last 100 s.

    depth: m, of the target below the ship; hold: s, after the time in which the winch could be there.
    """
    duration = (depth - 50.0) / RATE + hold
    scene = hybrid.load_scene(
        Path(__file__).with_name("rov_descent.yaml"),
        [f"time.duration={duration}", f"ends.end.payout={{longest: {depth + 50.0}}}"],
    )
    target, history = np.array([0.0, 0.0, -depth]), []
    step, rate, missed = 0.1, 0.0, np.zeros(3)
    with hybrid.Simulation(scene) as rov:
        while rov.t < duration - 0.5 * step:
            place, velocity = rov.state.position[0], rov.state.velocity[0]
            off = target - place
            wanted = np.clip(-WINCH * off[2], -RATE, RATE)
            rate += np.clip(wanted - rate, -SLOPE * step, SLOPE * step)
            rov.set_payout(rate)
            across = np.array([off[0], off[1], 0.0])
            thrust = PLACE * across + DRIFT * missed - SPEED * np.array([velocity[0], velocity[1], 0.0])
            if np.linalg.norm(thrust) < THRUST:
                missed += across * step
            thrust *= min(1.0, THRUST / max(np.linalg.norm(thrust), 1e-9))
            rov.set_force("start", thrust)
            rov.step()
            pull = np.linalg.norm(rov.forces().end)
            history.append((rov.t, rov.length, *off, np.linalg.norm(thrust), pull))
    t, length, x, y, z, thrust, pull = np.array(history).T
    held = t > duration - 100.0
    across, depth_error = float(np.hypot(x, y)[held].max()), float(-z[held].mean())
    print(f"{length[-1]:.1f} m of tether; across {across:.3f} m at most, depth {depth_error:+.3f} m in the mean, "
          f"up and down by {np.ptp(z[held]) / 2:.2f} m; thrust {thrust[held].mean():.0f} N, pull at the ship "
          f"{pull[held].min():.0f} to {pull[held].max():.0f} N")  # fmt: skip
    if picture is not None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 5), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(3, 1, sharex=True)
        for ax, values, label in zip(
            axes, (target[2] - z, np.hypot(x, y), pull / 1e3), ("z (m)", "off target (m)", "pull (kN)"), strict=True
        ):
            ax.plot(t, values)
            ax.set(ylabel=label)
        axes[1].plot(t, thrust / 1e3, label="thrust (kN)")
        axes[1].legend()
        axes[-1].set(xlabel="t (s)")
        figure.savefig(picture, dpi=120)
    return across, depth_error


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)

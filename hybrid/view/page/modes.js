// Modes swing, each once in two seconds; ticks turn with their sections.
(() => {
  "use strict";
  const PERIOD = 2.0; // s
  const button = document.getElementById("swing");
  const modes = [...document.querySelectorAll("svg.mode")].map((svg) => ({
    data: JSON.parse(svg.dataset.mode), curves: [...svg.querySelectorAll("polyline.swing")], ticks: [...svg.querySelectorAll("line.swing")],
  }));
  const draw = (part) => {
    for (const { data, curves, ticks } of modes) {
      curves.forEach((curve, k) => {
        const swing = data.swing[k];
        curve.setAttribute("points", data.rest[k].map(([x, y], i) => `${(x + part * swing[i][0]).toFixed(1)},${(y + part * swing[i][1]).toFixed(1)}`).join(" "));
      });
      ticks.forEach((tick, k) => {
        const [x, y, dx, dy, nx, ny, bx, by, turn] = data.ticks[k];
        const c = Math.cos(part * turn), s = Math.sin(part * turn), u = c * nx + s * bx, v = c * ny + s * by;
        const at = [x + part * dx, y + part * dy];
        tick.setAttribute("x1", at[0] - u); tick.setAttribute("y1", at[1] - v);
        tick.setAttribute("x2", at[0] + u); tick.setAttribute("y2", at[1] + v);
      });
    }
  };
  let moves = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  const show = () => { button.textContent = moves ? "Pause" : "Play"; button.setAttribute("aria-pressed", String(moves)); };
  const frame = (t) => { if (moves) draw(Math.sin(2 * Math.PI * t / 1000 / PERIOD)); requestAnimationFrame(frame); };
  button.addEventListener("click", () => { moves = !moves; show(); });
  show();
  draw(1);
  requestAnimationFrame(frame);
})();

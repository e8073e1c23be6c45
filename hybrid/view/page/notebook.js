(async () => {
  const place = document.getElementById("__NAME__");
  const plotly = window.hybridPlotly ? await window.hybridPlotly : window.Plotly;
  if (!plotly) {
    place.style.height = "auto";
    place.textContent = "No picture in space: run the notebook from its first result on, and export it again.";
    return;
  }
  await plotly.newPlot(place, __FIGURE__);
  place.dataset.drawn = "yes";
})();

// plotly.js, once for all figures of the page.  It is no AMD module here, whatever the page loads beside it.
window.hybridPlotly = (async () => {
  const bytes = Uint8Array.from(atob("__PACKED__"), (c) => c.charCodeAt(0));
  const text = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  const module = { exports: {} };
  new Function("module", "exports", "define", text)(module, module.exports, undefined);
  return module.exports.newPlot ? module.exports : window.Plotly;
})();

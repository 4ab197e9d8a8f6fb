// Plots of a campaign, each drawn by itself.
const LAYOUT = { margin: { l: 62, r: 22, t: 12, b: 44 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)" };
const OPTIONS = { displaylogo: false, responsive: true, modeBarButtons: [["zoom2d", "pan2d", "autoScale2d", "toImage"]] };
const coarse = matchMedia("(hover: none)").matches; // touch screen: a drag scrolls the page

function tracesOf({ kind, name, colour: place, x, y, low, high, full, large }) {
  const own = colour(`run-${place % 6}`);
  const common = { type: "scatter", name: plain(name), x: numbers(x), y: numbers(y) };
  if (kind === "bars") return [{ ...common, type: "bar", marker: { color: own }, opacity: 0.75 }];
  if (kind === "points") {
    const filled = full ? numbers(full) : null;
    const sized = large ? numbers(large) : null;
    const symbol = [...common.x].map((_, i) => (filled === null || filled[i] ? "circle" : "circle-open"));
    const size = [...common.x].map((_, i) => (sized !== null && sized[i] ? 9 : 5));
    return [{ ...common, mode: "markers", marker: { color: own, symbol, size } }];
  }
  const edge = (values) => ({ ...common, y: numbers(values), mode: "lines", showlegend: false, hoverinfo: "skip" });
  return [
    { ...edge(low), line: { color: own, width: 0.8, dash: "dot" } },
    { ...edge(high), line: { color: own, width: 0.8, dash: "dot" } },
    { ...common, mode: "lines", line: { color: own, width: 1.8 } },
  ];
}

function layoutOf(plot) {
  return {
    ...LAYOUT,
    font: { family: colour("text"), color: colour("ink"), size: 12 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("muted"), activecolor: colour("accent") },
    hoverlabel: hoverColours(),
    barmode: "overlay",
    dragmode: coarse ? false : "zoom",
    showlegend: plot.traces.length > 1,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
    xaxis: { ...axisColours(), title: { text: plain(plot.x), font: { size: 11 } } },
    yaxis: { ...axisColours(), title: { text: plain(plot.y), font: { size: 11 } } },
  };
}

async function draw() {
  for (const plot of report.plots) {
    const frame = document.querySelector(`[data-plot="${CSS.escape(plot.key)}"] .frame`);
    const config = { ...OPTIONS, displayModeBar: coarse ? false : "hover" };
    await Plotly.react(frame, plot.traces.flatMap(tracesOf), layoutOf(plot), config);
  }
}

dark.addEventListener("change", draw);
addEventListener("beforeprint", () => {
  for (const part of document.querySelectorAll("details")) part.open = true;
});
const drawn = draw();

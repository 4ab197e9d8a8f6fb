// Colours of the lines of runs.
function lineColour(plot, line) {
  const own = plot.series.length > 1 ? `series-${line.series % 7}` : `run-${report.runs[line.run].colour}`;
  return colour(own);
}

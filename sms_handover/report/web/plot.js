// One plot over time; link.js controls all of them together.
const MARGIN = { l: 62, r: 22, t: 22, b: 30 }; // px, fixed, so that a time has the same position in every plot
const DECADES = 8; // below the largest value on a logarithmic scale; smaller values are rounding errors
const MARK = { y: 1, xref: "x", yref: "paper", yanchor: "bottom", showarrow: false, borderpad: 0 }; // above a plot
const CONFIG = {
  displaylogo: false,
  doubleClick: false, // link.js handles it for all plots
  responsive: true,
  modeBarButtons: [["zoom2d", "pan2d", "toImage"]],
};
const coarse = matchMedia("(hover: none)").matches; // touch screen: a drag scrolls the page

class TimePlot {
  constructor(figure, plot) {
    this.plot = plot;
    this.frame = figure.querySelector(".frame");
    this.lines = plot.lines.map((line) => ({ ...line, time: numbers(line.time), values: numbers(line.values) }));
    this.hiddenSeries = new Set();
    this.unified = plot.lines.length <= 6; // more would not fit into one label
    this.cursor = document.createElement("div");
    this.cursor.className = "cursor";
  }

  async draw(view) {
    this.view = view;
    const filename = this.plot.key.replaceAll("/", "_");
    const config = { ...CONFIG, displayModeBar: coarse ? false : "hover", toImageButtonOptions: { format: "svg", filename } };
    await Plotly.newPlot(this.frame, this.traces(), this.layout(), config);
    this.frame.append(this.cursor);
  }

  traces() {
    return this.lines.map((line) => {
      const run = report.runs[line.run];
      const series = this.plot.series[line.series];
      return {
        type: "scatter",
        mode: "lines",
        name: plain(series ? `${series}, ${run.name}` : run.name),
        x: line.time,
        y: line.values,
        visible: this.shows(line),
        line: { color: lineColour(this.plot, line), dash: run.dash, width: 1.6 },
        hovertemplate: `%{y:.4g} ${this.plot.unit}${this.unified ? "" : " at %{x:.3f} s"}`,
      };
    });
  }

  layout() {
    return {
      margin: MARGIN,
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      font: { family: colour("text"), color: colour("ink") },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: colour("muted"), activecolor: colour("accent") },
      showlegend: false,
      hovermode: this.unified ? "x unified" : "closest",
      hoverdistance: -1, // the nearest line, however far
      hoverlabel: { ...hoverColours(), namelength: -1 },
      dragmode: coarse ? false : "zoom",
      xaxis: { ...axisColours(), range: [...this.view.range], zeroline: false, ticksuffix: " s", hoverformat: ".3f", fixedrange: coarse },
      yaxis: { ...axisColours(), ...this.valueAxis(), fixedrange: true, exponentformat: "power", nticks: 6 },
      shapes: [...phaseShapes(), ...this.levelShapes()],
      annotations: this.marks(),
    };
  }

  shows(line) {
    return !this.view.looks.hiddenRuns.has(line.run) && !this.hiddenSeries.has(line.series);
  }

  // Zooming alone is much quicker than a redraw for another scale, other colours or other lines.
  async update(view) {
    const zoomed = view.looks === this.view.looks;
    this.view = view;
    if (zoomed) {
      const { range } = this.valueAxis();
      const changes = { "xaxis.range": [...view.range], "yaxis.range": range, annotations: this.marks() };
      await Plotly.relayout(this.frame, changes);
    } else {
      await this.redraw();
    }
  }

  redraw() {
    return Plotly.react(this.frame, this.traces(), this.layout());
  }

  marks() {
    return [...phaseNames(this.view.range), ...eventMarks()];
  }

  // Lines across the plot, such as the distance at which bodies touch.
  levelShapes() {
    return this.plot.levels.map(({ value, text }, place) => ({
      type: "line",
      xref: "paper",
      x0: 0,
      x1: 1,
      y0: value,
      y1: value,
      line: { width: 1, dash: place ? "dot" : "solid", color: colour("bad") },
      label: { text: plain(text), textposition: "end", yanchor: place ? "top" : "bottom", font: { size: 10, color: colour("bad") } },
    }));
  }

  // Show the values at a time, as if the pointer were there; null for none.
  showValues(time) {
    if (!this.unified) return;
    if (time === null) Plotly.Fx.unhover(this.frame);
    else Plotly.Fx.hover(this.frame, { xval: time }, "xy");
  }

  // The visible values fill the height.
  valueAxis() {
    const { range } = this.view;
    const end = range[1] < report.span[1] ? range[1] : Infinity; // at its end the next phase begins
    let [low, high, smallest] = [Infinity, -Infinity, Infinity];
    for (const line of this.lines) {
      if (!this.shows(line)) continue;
      for (let i = 0; i < line.time.length; i += 1) {
        const value = line.values[i];
        const outside = line.time[i] < range[0] || line.time[i] >= end;
        if (outside || Number.isNaN(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
        if (value > 0) smallest = Math.min(smallest, value);
      }
    }
    if (this.plot.magnitude && this.view.looks.logarithmic && smallest < Infinity) {
      const top = Math.log10(high);
      const bottom = Math.max(Math.log10(smallest), top - DECADES);
      return { type: "log", range: [bottom - 0.1, top + 0.2], tickfont: { color: colour("muted"), size: 9 } };
    }
    if (!(high >= low)) return { type: "linear", range: [0, 1] };
    for (const { value } of this.plot.levels) low = Math.min(low, value);
    high = Math.max(Math.min(high, this.plot.ceiling ?? high), low);
    const room = 0.06 * (high - low) || Math.abs(high) || 1;
    return { type: "linear", range: [this.plot.magnitude ? -room / 2 : low - room, high + room] };
  }

  // The position of a time, and the time at a position, in px from the left of the frame.
  placeOf(time) {
    const [begin, end] = this.view.range;
    return MARGIN.l + ((time - begin) / (end - begin)) * (this.frame.clientWidth - MARGIN.l - MARGIN.r);
  }

  timeAt(place) {
    const [begin, end] = this.view.range;
    return begin + ((place - MARGIN.l) / (this.frame.clientWidth - MARGIN.l - MARGIN.r)) * (end - begin);
  }

  showCursor(time) {
    const [begin, end] = this.view.range;
    const inside = time !== null && time >= begin && time <= end;
    this.cursor.style.visibility = inside ? "visible" : "hidden";
    if (!inside) return;
    this.cursor.style.height = `${this.frame.clientHeight - MARGIN.t - MARGIN.b}px`;
    this.cursor.style.transform = `translate(${this.placeOf(time)}px, ${MARGIN.t}px)`;
  }
}

function phaseShapes() {
  return report.phases.map((phase, place) => ({
    type: "rect",
    layer: "below",
    xref: "x",
    yref: "paper",
    x0: phase.begin,
    x1: phase.end,
    y0: 0,
    y1: 1,
    line: { width: 0 },
    fillcolor: place % 2 ? colour("shade") : "rgba(0,0,0,0)",
  }));
}

// Above the plot, if the name fits.
function phaseNames([begin, end]) {
  return report.phases
    .map((phase) => ({ ...phase, from: Math.max(phase.begin, begin), to: Math.min(phase.end, end) }))
    .filter(({ from, to }) => to - from > 0.15 * (end - begin))
    .map(({ name, from }) => ({
      ...MARK,
      x: from,
      xanchor: "left",
      xshift: 6,
      text: plain(name),
      font: { size: 11, color: colour("muted") },
    }));
}

function eventMarks() {
  return report.events.map((event) => ({
    ...MARK,
    x: event.time,
    text: event.succeeded ? "▾" : "✗",
    font: { size: 14, color: colour(event.succeeded ? "accent" : "bad") },
    hovertext: plain(`${event.time} s: ${event.text}`),
  }));
}

// Set up the page: plots, the buttons above them, and the animation.
const plots = new LinkedPlots(
  report.plots
    .filter((plot) => plot.lines.length > 0)
    .map((plot) => new TimePlot(document.querySelector(`[data-plot="${CSS.escape(plot.key)}"]`), plot)),
);

function addRangeButtons() {
  const box = document.querySelector(".ranges");
  const around = 1; // s before and after a grasp command
  const ranges = [
    { text: "whole run", range: report.span },
    ...report.phases.map((phase) => ({ text: phase.name, range: [phase.begin, phase.end] })),
    ...report.events.map((event) => ({ text: `${event.time} s ± ${around} s`, range: [event.time - around, event.time + around] })),
  ];
  const clamped = ([begin, end]) => [Math.max(begin, report.span[0]), Math.min(end, report.span[1])];
  const buttons = ranges.map(({ text, range }) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.addEventListener("click", () => plots.zoom(range));
    box.append(button);
    return { button, range: clamped(range) };
  });
  plots.onZoom = (now) => {
    for (const { button, range } of buttons) {
      const pressed = range.every((time, place) => Math.abs(time - now[place]) < 1e-6);
      button.setAttribute("aria-pressed", String(pressed));
    }
  };
  plots.onZoom(report.span);
}

function addChoices() {
  for (const box of document.querySelectorAll("[data-run]")) {
    box.addEventListener("change", () => {
      const hiddenRuns = new Set(plots.view.looks.hiddenRuns);
      hiddenRuns[box.checked ? "delete" : "add"](Number(box.dataset.run));
      plots.restyle({ hiddenRuns });
    });
  }
  const scale = document.getElementById("logarithmic");
  scale.addEventListener("change", () => plots.restyle({ logarithmic: scale.checked }));
  for (const plot of plots.plots) {
    for (const button of plot.frame.closest("figure").querySelectorAll("[data-series]")) {
      button.addEventListener("click", () => {
        const shown = button.getAttribute("aria-pressed") === "false";
        button.setAttribute("aria-pressed", String(shown));
        plot.hiddenSeries[shown ? "delete" : "add"](Number(button.dataset.series));
        plot.redraw();
      });
    }
  }
  const output = document.getElementById("cursor-time");
  plots.onTime = (time) => {
    output.textContent = time === null ? "" : `t = ${time.toFixed(3)} s`;
  };
}

// The animation is in its own frame; both sides send each other the time.
function linkAnimation() {
  const frame = document.querySelector("#animation iframe");
  if (!frame) return;
  addEventListener("message", (event) => {
    if (event.source !== frame.contentWindow || event.data?.type !== "time") return;
    plots.chosen = Number(event.data.t);
    plots.showTime(plots.chosen);
  });
  plots.onSeek = (time) => frame.contentWindow.postMessage({ type: "time", t: time }, "*");
}

function followTheme() {
  dark.addEventListener("change", () => plots.restyle({}));
  addEventListener("beforeprint", () => {
    for (const part of document.querySelectorAll("details")) part.open = true;
  });
}

addRangeButtons();
addChoices();
linkAnimation();
followTheme();
const drawn = plots.draw();

// Colours come from the style sheet, so that light, dark and print look alike everywhere on the page.
const dark = matchMedia("(prefers-color-scheme: dark)");

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function axisColours() {
  const axis = { gridcolor: colour("grid"), linecolor: colour("line"), zerolinecolor: colour("line") };
  return { ...axis, tickfont: { color: colour("muted"), size: 11 } };
}

function hoverColours() {
  return { bgcolor: colour("card"), bordercolor: colour("line"), font: { color: colour("ink"), size: 12 } };
}

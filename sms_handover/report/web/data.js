// What the page was given to draw, and texts made safe for plotly.
"use strict";
const report = JSON.parse(document.getElementById("report-data").textContent);

// Numbers travel as base64 of little-endian float32.
function numbers(base64) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

// Plotly reads some tags in texts; a text of a bag must show as it is.
function plain(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
}

// The data of the page, and texts escaped for plotly.
"use strict";
const report = JSON.parse(document.getElementById("report-data").textContent);

// Numbers are encoded as base64 of little-endian float32.
function numbers(base64) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

// Plotly interprets some tags in texts; a text from a bag must appear literally.
function plain(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
}

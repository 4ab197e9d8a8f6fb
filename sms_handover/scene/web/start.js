"use strict";
/* Starts playing the data of the page, or following a running graph. */

/** Show a message instead of the 3D view; an empty text hides it. */
function notice(text) {
  element("trouble").hidden = !text;
  element("trouble").textContent = text;
}

function begin(data) {
  try {
    window.player = new Player(data);
  } catch (error) {
    notice(`This browser cannot draw the 3D view: ${error.message}`);
    throw error;
  }
}

/** Follow a stream: the current scene, then updates; another scene is another run. */
function follow(address) {
  const stream = new EventSource(address);
  const on = (name, take) => stream.addEventListener(name, (event) => take(JSON.parse(event.data)));
  on("waiting", ({ text }) => notice(text));
  on("scene", (run) => {
    if (window.player) { window.location.reload(); return; }
    notice("");
    begin({ runs: [run], live: true });
  });
  on("frames", (news) => window.player.extend(news));
}

const carried = JSON.parse(element("data").textContent);
if (carried.stream) follow(carried.stream); else begin(carried);

"use strict";
/* Begins to play what the page carries, or to follow what a running graph sends. */

/** Say something in place of the picture; nothing takes it away. */
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

/** Follow a stream: the scene as it is, then what is new; another scene is another run. */
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

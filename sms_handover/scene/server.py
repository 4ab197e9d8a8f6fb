"""Server of a live scene to browsers on this machine: the page, and its frames as server-sent events."""

import json
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from time import sleep

from sms_handover.errors import ConfigurationError
from sms_handover.scene.document import Document
from sms_handover.scene.live import LiveScene, Seen
from sms_handover.scene.page import STREAM, live_html

_HOST = "127.0.0.1"  # this machine only, so there is no authentication
_NAMES = ("127.0.0.1", "localhost")  # accepted hosts in a request; any port, as one may be forwarded
_KEEP_ALIVE_S = 1.0  # [s] of wall time after which an idle stream sends an event

FindScene = Callable[[], LiveScene | str]  # the scene, or a message about what it waits for


class SceneServer:
    """Serves in its own threads until it is closed."""

    def __init__(self, find: FindScene, port: int, title: str) -> None:
        """Start on ``port``, 0 for any free one; raises ConfigurationError if it is in use."""
        page = live_html(title=title).encode()

        class Handler(_Handler):
            """Handler of this server."""

            scene = staticmethod(find)
            content = page

        try:
            self._server = ThreadingHTTPServer((_HOST, port), Handler)
        except OSError as error:
            raise ConfigurationError(
                f"port {port} cannot be served: {error.strerror}; choose another, 0 takes any free one"
            ) from error
        self._server.daemon_threads = True
        self.address = f"http://{_HOST}:{self._server.server_port}/"
        Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    """Handles the two requests: page and stream."""

    scene: FindScene
    content: bytes

    def do_GET(self) -> None:
        """Send the page or the stream; reject other host names, which a site could point to this machine."""
        name, _, _ = self.headers.get("Host", "").rpartition(":")
        if name not in _NAMES:
            self.send_error(403, f"ask for {_HOST}")
        elif self.path == "/":
            self._head("text/html; charset=utf-8")
            self.wfile.write(self.content)
        elif self.path == f"/{STREAM}":
            self._head("text/event-stream")
            try:
                self._stream()
            except OSError:  # the browser disconnected
                return
        else:
            self.send_error(404)

    def log_message(self, format: str, *arguments: object) -> None:
        """Do not log requests."""

    def _head(self, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _stream(self) -> None:
        """Send updates as they come."""
        before, seen = None, Seen()
        while True:
            scene = self.scene()
            if isinstance(scene, str):
                self._send("waiting", {"text": scene})
                sleep(_KEEP_ALIVE_S)
                continue
            if scene is not before:
                before, seen = scene, Seen()
            update = scene.updates(seen, _KEEP_ALIVE_S)
            if update is None:
                self._send("waiting", {"text": "" if seen.frames else "Waiting for a run to start"})
                continue
            document, seen = update
            self._send("scene" if "shapes" in document else "frames", document)

    def _send(self, event: str, document: Document) -> None:
        text = json.dumps(document, allow_nan=False, separators=(",", ":"))
        self.wfile.write(f"event: {event}\ndata: {text}\n\n".encode())
        self.wfile.flush()

"""A camera as MJPEG over HTTP (multipart/x-mixed-replace), as web_video_server with type=ros_compressed sends it.

    mjpeg.py PORT

The server passes JPEG on without decoding and sends each client the newest picture. This delays pictures less
than web_video_server's queues. Run by the distribution's Python, on the master in ROS_MASTER_URI.
"""

from __future__ import annotations

import signal
import socket
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import rospy
from sensor_msgs.msg import CompressedImage

TOPIC = "/xtion/rgb/image_raw/compressed"
BOUNDARY = b"--boundarydonotcross\r\n"
PAGE = b"<!doctype html><title>MJPEG</title><img src=/stream><canvas width=640 height=480></canvas>"


class Newest:
    """The newest picture, and its number."""

    def __init__(self) -> None:
        self._news = threading.Condition()
        self._picture = b""
        self._number = 0

    def set(self, message: CompressedImage) -> None:
        """Replace the picture."""
        with self._news:
            self._picture = bytes(message.data)
            self._number += 1
            self._news.notify_all()

    def after(self, number: int) -> tuple[int, bytes]:
        """Wait for a newer picture than `number`."""
        with self._news:
            self._news.wait_for(lambda: self._number > number)
            return self._number, self._picture


class Handler(BaseHTTPRequestHandler):
    """Serves the page and its stream."""

    newest = Newest()
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        """Answer one request. A stream continues until the client closes the connection."""
        self.send_response(200)
        if self.path != "/stream":
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(PAGE)))
            self.end_headers()
            self.wfile.write(PAGE)
            return
        self.send_header("Content-Type", "multipart/x-mixed-replace;boundary=boundarydonotcross")
        self.end_headers()
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.wfile.write(BOUNDARY)
        number = 0
        try:
            while True:
                number, picture = self.newest.after(number)
                head = b"Content-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture)
                # Send the next boundary at once: a browser shows a part only when its end has come.
                self.wfile.write(head + picture + b"\r\n" + BOUNDARY)
        except OSError:
            return

    def log_message(self, format: str, *args: object) -> None:
        """Write no log."""


def main() -> None:
    """Serve the head camera's pictures for ever."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    rospy.init_node("bench_mjpeg", anonymous=True, disable_signals=True)
    rospy.Subscriber(TOPIC, CompressedImage, Handler.newest.set, queue_size=1, tcp_nodelay=True)
    server = ThreadingHTTPServer(("127.0.0.1", int(sys.argv[1])), Handler)
    server.daemon_threads = True
    server.serve_forever()


if __name__ == "__main__":
    main()

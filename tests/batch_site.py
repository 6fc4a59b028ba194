"""A web server of a folder, with index pages, for tests of logs that lie elsewhere."""

import http.server
import threading
from contextlib import contextmanager
from functools import partial


class Site(http.server.SimpleHTTPRequestHandler):
    """What `answers` holds by path goes before the folder: statuses, each used up by one GET."""

    answers: dict = {}  # noqa: RUF012

    def log_message(self, *_args):
        pass

    def do_GET(self):
        statuses = self.answers.get(self.path.partition("?")[0], [])
        if statuses and self.command == "GET":
            self.send_error(statuses.pop(0))
            return
        super().do_GET()


@contextmanager
def served(folder):
    """The address of the folder while the block lasts."""
    handler = partial(Site, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()

"""Static hosts with range requests: a minimal one, and public objects of an S3 server."""

import re
import threading
import urllib.request
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer


class RangeHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_GET(self):
        asked = re.fullmatch(r"bytes=([0-9]+)-([0-9]+)", self.headers.get("Range", ""))
        if not asked:
            super().do_GET()
            return
        with open(self.translate_path(self.path), "rb") as file:
            file.seek(int(asked[1]))
            data = file.read(int(asked[2]) - int(asked[1]) + 1)
        self.send_response(206)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


@contextmanager
def static_host(folder):
    """Serves the folder and yields the address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(RangeHandler, directory=str(folder))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


def public_address(endpoint, url, names):
    """Lets everyone read objects of an S3 server, as on a public web host. Returns their address."""
    address = f"{endpoint}/{url.removeprefix('s3://')}"
    for name in names:
        request = urllib.request.Request(
            f"{address}/{name}?acl", data=b"", method="PUT", headers={"x-amz-acl": "public-read", "Authorization": "AWS test-key:any"}
        )
        with urllib.request.urlopen(request, timeout=30) as answer:
            assert answer.status == 200
    return address

"""Static hosts with range requests: a minimal one, nginx, and public objects of an S3 server."""

import os
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import urllib.request
from contextlib import contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest


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


_NGINX = """
daemon off;
{user}
worker_processes 1;
pid {run}/nginx.pid;
error_log stderr warn;
events {{ worker_connections 64; }}
http {{
  access_log off;
  default_type application/octet-stream;
  client_body_temp_path {run}/body; proxy_temp_path {run}/proxy; fastcgi_temp_path {run}/fastcgi;
  uwsgi_temp_path {run}/uwsgi; scgi_temp_path {run}/scgi;
  server {{ listen 127.0.0.1:{port}; root "{folder}"; }}
}}
"""


@contextmanager
def nginx_host(folder):
    """Serves the folder with nginx and yields the address; skips the test without nginx."""
    program = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    if program is None:
        pytest.skip("nginx is not installed: apt-get install nginx-light")
    with tempfile.TemporaryDirectory() as run, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()
        config = Path(run, "nginx.conf")
        config.write_text(_NGINX.format(user="user root;" if os.getuid() == 0 else "", run=run, port=port, folder=folder))
        process = subprocess.Popen([program, "-p", run, "-c", str(config)], stderr=subprocess.PIPE, text=True)
        try:
            _wait_for(process, port)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.communicate(timeout=30)


def _wait_for(process, port):
    """Waits until the server accepts connections; fails with its messages if it ends."""
    while process.poll() is None:
        with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port), timeout=30):
            return
    raise AssertionError(f"nginx ended: {process.stderr.read()}")

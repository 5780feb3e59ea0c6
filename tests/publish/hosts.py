"""Static hosts: a minimal one with range requests, web servers as Debian installs them, and public objects of an S3 server."""

import os
import re
import shutil
import socket
import subprocess
import tempfile
import threading
import urllib.request
from contextlib import contextmanager, suppress
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Program:
    """A web server as installed: only port and folder are set, media types are its own or Debian's."""

    program: str
    package: str
    config: str
    arguments: tuple[str, ...]
    """`{config}`, `{run}`, `{port}` and `{folder}` are filled in."""


PROGRAMS = {
    "nginx": Program(
        "nginx",
        "nginx-light",
        """
daemon off;
{user}
worker_processes 1;
pid {run}/nginx.pid;
error_log stderr warn;
events {{ worker_connections 64; }}
http {{
  access_log off;
  include /etc/nginx/mime.types;
  default_type application/octet-stream;
  gzip on;
  client_body_temp_path {run}/body; proxy_temp_path {run}/proxy; fastcgi_temp_path {run}/fastcgi;
  uwsgi_temp_path {run}/uwsgi; scgi_temp_path {run}/scgi;
  server {{ listen 127.0.0.1:{port}; root "{folder}"; }}
}}
""",
        ("-p", "{run}", "-c", "{config}"),
    ),
    "apache": Program(
        "apache2",
        "apache2",
        """
ServerName localhost
ServerRoot {run}
DefaultRuntimeDir {run}
PidFile {run}/apache.pid
ErrorLog /dev/stderr
LogLevel error
Listen 127.0.0.1:{port}
LoadModule mpm_event_module /usr/lib/apache2/modules/mod_mpm_event.so
LoadModule authz_core_module /usr/lib/apache2/modules/mod_authz_core.so
LoadModule dir_module /usr/lib/apache2/modules/mod_dir.so
LoadModule filter_module /usr/lib/apache2/modules/mod_filter.so
LoadModule deflate_module /usr/lib/apache2/modules/mod_deflate.so
LoadModule mime_module /usr/lib/apache2/modules/mod_mime.so
Include /etc/apache2/mods-available/mime.conf
Include /etc/apache2/mods-available/dir.conf
Include /etc/apache2/mods-available/deflate.conf
DocumentRoot "{folder}"
<Directory "{folder}">
  Require all granted
</Directory>
""",
        ("-DFOREGROUND", "-f", "{config}"),
    ),
    "caddy": Program("caddy", "caddy", "", ("file-server", "--root", "{folder}", "--listen", "127.0.0.1:{port}")),
    "lighttpd": Program(
        "lighttpd",
        "lighttpd",
        """
server.bind = "127.0.0.1"
server.port = {port}
server.document-root = "{folder}"
index-file.names = ("index.html")
include_shell "/usr/share/lighttpd/create-mime.conf.pl"
""",
        ("-D", "-f", "{config}"),
    ),
}


@contextmanager
def web_host(name, folder):
    """Serves the folder with a program of PROGRAMS and yields the address; skips the test where it is not installed."""
    host = PROGRAMS[name]
    program = shutil.which(host.program) or shutil.which(host.program, path="/usr/sbin")
    if program is None:
        pytest.skip(f"{name} is not installed: apt-get install {host.package}")
    with tempfile.TemporaryDirectory() as run, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()
        # Servers that give up root read neither folders of pytest nor this one by default.
        readable = Path(run, "folder")
        shutil.copytree(folder, readable)
        Path(run).chmod(0o755)
        values = {"user": "user root;" if os.getuid() == 0 else "", "run": run, "port": port, "folder": readable, "config": Path(run, "config")}
        values["config"].write_text(host.config.format(**values))
        environment = {**os.environ, "HOME": run, "XDG_DATA_HOME": run, "XDG_CONFIG_HOME": run}
        process = subprocess.Popen(
            [program, *(argument.format(**values) for argument in host.arguments)], stderr=subprocess.PIPE, text=True, env=environment
        )
        try:
            _wait_for(name, process, port)
            yield f"http://127.0.0.1:{port}"
        finally:
            process.terminate()
            process.communicate(timeout=30)


def _wait_for(name, process, port):
    """Waits until the server accepts connections; fails with its messages if it ends."""
    while process.poll() is None:
        with suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", port), timeout=30):
            return
    raise AssertionError(f"{name} ended: {process.stderr.read()}")

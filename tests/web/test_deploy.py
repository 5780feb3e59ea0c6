"""The examples in deploy/ are accepted by the programs that read them, as far as those are installed."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from map3d.web.http.settings import load_settings

DEPLOY = Path(__file__).parents[2] / "deploy"


def test_the_example_of_a_configuration_file_is_valid(monkeypatch):
    for variable in ("MAP3D_HOST", "MAP3D_PORT", "MAP3D_PROCESSES", "MAP3D_PUBLIC_URL", "MAP3D_CONFIG"):
        monkeypatch.delenv(variable, raising=False)
    settings = load_settings(DEPLOY / "server.toml")
    assert (settings.processes, settings.public_url) == (2, "https://maps.example.org")


@pytest.mark.parametrize("name", ["nginx.conf", "nginx-compose.conf"])
def test_nginx_accepts_its_configuration(tmp_path, name):
    nginx = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    if nginx is None:
        pytest.skip("nginx is not installed; apt install nginx-light")
    site = tmp_path / "site.conf"
    site.write_text((DEPLOY / name).read_text().replace("server server:8080;", "server 127.0.0.1:8080;"))
    main = tmp_path / "nginx.conf"
    main.write_text(f"pid {tmp_path}/pid;\nerror_log {tmp_path}/error.log;\nevents {{}}\nhttp {{ include {site}; }}\n")
    done = subprocess.run([nginx, "-t", "-c", str(main)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_both_nginx_examples_differ_in_addresses_only():
    first, second = ((DEPLOY / name).read_text().splitlines()[1:] for name in ("nginx.conf", "nginx-compose.conf"))
    differing = [(one, other) for one, other in zip(first, second, strict=True) if one != other]
    assert [one.split()[0] for one, _ in differing] == ["server", "server_name"]


@pytest.mark.parametrize("name", ["map3d.service", "map3d-work.service"])
def test_systemd_accepts_the_units(tmp_path, name):
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("systemd-analyze is not installed; apt install systemd")
    unit = tmp_path / name
    unit.write_text((DEPLOY / name).read_text().replace("/opt/map3d/bin/map3d", "/bin/true"))
    done = subprocess.run([analyze, "verify", "--man=no", str(unit)], capture_output=True, text=True, check=False)
    assert (done.returncode, [line for line in done.stderr.splitlines() if name in line]) == (0, [])


def test_the_stop_timeouts_leave_time_to_drain():
    drain_s = load_settings(DEPLOY / "server.toml").drain_s
    stop = re.search(r"TimeoutStopSec=(\d+)", (DEPLOY / "map3d.service").read_text())
    grace = re.search(r"stop_grace_period: (\d+)s", (DEPLOY / "compose.yaml").read_text())
    assert stop is not None
    assert grace is not None
    assert min(int(stop[1]), int(grace[1])) > drain_s

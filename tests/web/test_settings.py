"""Where settings come from, and what is refused."""

import re
from pathlib import Path

import pytest

from map3d.errors import BadRequest, NotFound
from map3d.web.http.settings import SETTINGS, ServerSettings, load_settings

DOCS = Path(__file__).parents[2] / "docs" / "server.md"


@pytest.fixture(autouse=True)
def no_environment(monkeypatch):
    for name in ("MAP3D_CONFIG", *(setting.variable for setting in SETTINGS)):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def config(tmp_path) -> Path:
    path = tmp_path / "server.toml"
    lines = ('host = "0.0.0.0"', "port = 9000", "processes = 4", "on_demand = true", "on_demand_quota_gb = 2.5", 'metrics = "127.0.0.1:9464"')
    path.write_text("\n".join((*lines, "access_log = true")))
    return path


def test_without_anything_there_are_defaults():
    assert load_settings() == ServerSettings()


def test_a_file_has_settings(config):
    settings = load_settings(config)
    assert (settings.host, settings.port, settings.processes, settings.access_log) == ("0.0.0.0", 9000, 4, True)
    assert settings.metrics == ("127.0.0.1", 9464)
    assert settings.on_demand is not None
    assert settings.on_demand.quota_bytes == 2_500_000_000


def test_the_environment_is_before_the_file_and_options_are_before_both(config, monkeypatch):
    monkeypatch.setenv("MAP3D_CONFIG", str(config))
    monkeypatch.setenv("MAP3D_PORT", "9001")
    monkeypatch.setenv("MAP3D_ON_DEMAND", "no")
    assert (load_settings().port, load_settings().on_demand) == (9001, None)
    assert load_settings(options={"port": 9002, "host": None}).port == 9002
    assert load_settings(options={"port": 9002, "host": None}).host == "0.0.0.0"


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("port", "65536", "0 to 65535"), ("port", "-1", "0 to 65535"), ("port", "\u0661", "0 to 65535"), ("port", "1e3", "0 to 65535"),
        ("processes", "0", "1 to 64"), ("processes", "65", "1 to 64"), ("on_demand", "maybe", "true or false"), ("log_format", "xml", "text or json"),
        ("on_demand_quota_gb", "0", "greater than 0"), ("on_demand_quota_gb", "NaN", "greater than 0"),
        ("on_demand_quota_gb", "-1", "greater than 0"),
        ("trusted_proxies", "proxy", "addresses and networks"),
        ("frame_ancestors", "example.org", "such as https://example.org"), ("frame_ancestors", "*; script-src *", "such as https://example.org"),
        ("metrics", "9464", "HOST:PORT"), ("metrics", "x:y", "0 to 65535"), ("public_url", "maps.example", "https://example.org/maps"),
    ],
)  # fmt: skip
def test_an_invalid_value_is_refused(tmp_path, monkeypatch, key, value, expected):
    path = tmp_path / "server.toml"
    path.write_text(f'{key} = "{value}"\n')
    with pytest.raises(BadRequest, match=re.escape(expected)):
        load_settings(path)
    monkeypatch.setenv(f"MAP3D_{key.upper()}", value)
    with pytest.raises(BadRequest, match=re.escape(expected)):
        load_settings()


@pytest.mark.parametrize("value", ["port = true", "processes = 1.5", "host = 3", 'host = ""', "access_log = 7"])
def test_a_value_of_another_type_is_refused(tmp_path, value):
    path = tmp_path / "server.toml"
    path.write_text(value)
    with pytest.raises(BadRequest, match="expected"):
        load_settings(path)


def test_an_unknown_setting_and_a_file_that_is_none_are_refused(tmp_path):
    path = tmp_path / "server.toml"
    path.write_text("prot = 1")
    with pytest.raises(BadRequest, match=r"unknown setting 'prot'; the settings are host, port"):
        load_settings(path)
    path.write_text("port = ")
    with pytest.raises(BadRequest, match="not a TOML file"):
        load_settings(path)
    with pytest.raises(NotFound):
        load_settings(tmp_path / "none.toml")


def test_the_table_in_the_docs_has_every_setting():
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \| (.*?) \| (.*) \|$", DOCS.read_text("utf-8"), re.MULTILINE)
    assert [(key, variable) for key, variable, _, _ in rows] == [(setting.key, setting.variable) for setting in SETTINGS]
    assert [default.strip("`") for _, _, default, _ in rows] == [setting.default or "none" for setting in SETTINGS]

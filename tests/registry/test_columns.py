"""Attributes by column: the index and the columns."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from map3d.registry import NewObject, Registry
from map3d.registry import columns as columns_module
from map3d.registry.columns import column_key


@pytest.fixture
def registry(tmp_path: Path) -> Iterator[Registry]:
    with Registry(tmp_path / "registry.sqlite") as opened:
        yield opened


def thing(name: str, attributes: Mapping[str, Any], parent: int | None = None, kind: str = "building") -> NewObject:
    return NewObject(name, kind, parent=parent, attributes=attributes)


def column_of(registry: Registry, name: str, of: str = "attributes") -> dict[int, Any]:
    document = registry.column(column_key(of, name))
    assert document is not None
    assert (document["map3d"], document["version"], document["name"], document["of"]) == ("column", 1, name, of)
    assert document["ids"] == sorted(document["ids"])
    return dict(zip(document["ids"], document["values"], strict=True))


def row_of(registry: Registry, name: str) -> dict[str, Any]:
    (row,) = (row for row in registry.attribute_index()["attributes"] if (row["name"], row["of"]) == (name, "attributes"))
    found: dict[str, Any] = row
    return found


def test_a_column_has_the_values_of_the_objects(registry: Registry) -> None:
    values = [12.5, 9, -3, 1e300, 2**70, "text", "1000", "", True, False, 'a"b\0\u20ac']
    ids = registry.put_asset("a", [thing(str(k), {"value": value, "other": k}) for k, value in enumerate(values)]).tolist()
    found = column_of(registry, "value")
    assert [(type(found[number]), found[number]) for number in ids] == [(type(value), value) for value in values]


def test_the_index_counts_values(registry: Registry) -> None:
    registry.put_asset(
        "a", [thing("x", {"height": 3, "year": "1900"}), thing("y", {"height": 7.5, "year": None}), thing("z", {"height": 3, "flag": True})]
    )
    assert row_of(registry, "height") | {"column": ""} == {
        "name": "height",
        "of": "attributes",
        "column": "",
        "type": "number",
        "objects": 3,
        "variety": 2,
        "min": 3,
        "max": 7.5,
    }
    assert (row_of(registry, "year")["type"], row_of(registry, "year")["objects"]) == ("text", 1)
    assert row_of(registry, "flag")["type"] == "boolean"
    names = [row["name"] for row in registry.attribute_index()["attributes"]]
    assert names == ["class", "asset", "flag", "height", "year"]


def test_values_of_several_types_are_mixed(registry: Registry) -> None:
    registry.put_asset("a", [thing("x", {"v": 3}), thing("y", {"v": "3"}), thing("z", {"v": 4.5})])
    row = row_of(registry, "v")
    assert (row["type"], row["objects"], row["variety"]) == ("mixed", 3, 3)
    assert "min" not in row


def test_children_inherit_the_values_of_their_ancestors(registry: Registry) -> None:
    objects = [
        thing("house", {"year": 1900}),
        thing("wing", {}, 0),
        thing("tower", {"year": 1950}, 0),
        thing("roof", {"year": None}, 1),
        thing("shed", {}),
    ]
    house, wing, tower, roof, shed = registry.put_asset("a", objects).tolist()
    assert column_of(registry, "year") == {house: 1900, wing: 1900, tower: 1950, roof: 1900}
    assert row_of(registry, "year")["objects"] == 2
    assert shed not in column_of(registry, "year")


def test_class_and_asset_are_separate_from_attributes_of_the_same_name(registry: Registry) -> None:
    (one,) = registry.put_asset("a", [thing("x", {"class": "own"}, kind="bridge")]).tolist()
    assert column_of(registry, "class", "object") == {one: "bridge"}
    assert column_of(registry, "asset", "object") == {one: "a"}
    assert column_of(registry, "class") == {one: "own"}


def test_removed_objects_are_in_no_column(registry: Registry) -> None:
    registry.put_asset("a", [thing("x", {"old": 1})])
    registry.put_asset("a", [thing("y", {"new": 1})])
    assert [row["name"] for row in registry.attribute_index()["attributes"]] == ["class", "asset", "new"]
    assert registry.column(column_key("attributes", "old")) is None


def test_columns_do_not_depend_on_the_memory_limit(registry: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    registry.put_asset("a", [thing(str(k), {"b": k, "c": str(k), "d": None if k else 1}) for k in range(5)])
    whole = dict(registry.columns())
    assert whole == {row["column"]: registry.column(row["column"]) for row in registry.attribute_index()["attributes"]}
    monkeypatch.setattr(columns_module, "VALUES_IN_MEMORY", 6)
    assert dict(registry.columns()) == whole
    assert len(whole) == 5


def test_an_empty_registry_has_no_columns(registry: Registry) -> None:
    assert registry.attribute_index() == {"map3d": "attributes", "version": 1, "attributes": [], "left_out": 0}
    assert dict(registry.columns()) == {}
    assert registry.column("0" * 16) is None


def test_rare_attributes_are_omitted_and_counted(registry: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns_module, "MAX_COLUMNS", 2)
    registry.put_asset("a", [thing("x", {"b": 1, "c": 1, "a": 1}), thing("y", {"c": 1})])
    index = registry.attribute_index()
    assert [row["name"] for row in index["attributes"]] == ["class", "asset", "a", "c"]
    assert index["left_out"] == 1
    assert {document["name"] for _, document in registry.columns()} == {"class", "asset", "a", "c"}

"""Attributes by column: the index and the columns."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from map3d.registry import NewObject, Registry
from map3d.registry import column_documents as documents_module
from map3d.registry import columns as columns_module
from map3d.registry.columns import column_key


@pytest.fixture
def registry(tmp_path: Path) -> Iterator[Registry]:
    with Registry(tmp_path / "registry.sqlite") as opened:
        yield opened


def thing(name: str, attributes: Mapping[str, Any], parent: int | None = None, kind: str = "building") -> NewObject:
    return NewObject(name, kind, parent=parent, attributes=attributes)


def columns_of(registry: Registry) -> dict[str, dict[str, Any]]:
    """Returns the documents below objects/columns by path without suffix."""
    below = "objects/columns/"
    return {name.removeprefix(below).removesuffix(".json"): json.loads(data) for name, data in registry.column_documents() if name.startswith(below)}


def column_of(registry: Registry, name: str, of: str = "attributes") -> dict[int, Any]:
    document = columns_of(registry)[f"{column_key(of, name)}"]
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
    assert column_key("attributes", "old") not in columns_of(registry)


def test_every_listed_column_is_written_once(registry: Registry) -> None:
    registry.put_asset("a", [thing(str(k), {"b": k, "c": str(k), "d": None if k else 1}) for k in range(5)])
    names = [name for name, _ in registry.column_documents()]
    assert sorted(names) == sorted(
        {"objects/attributes.json", *(f"objects/columns/{row['column']}.json" for row in registry.attribute_index()["attributes"])}
    )


def test_an_empty_registry_has_no_columns(registry: Registry) -> None:
    assert registry.attribute_index() == {"map3d": "attributes", "version": 1, "attributes": [], "left_out": 0}
    assert columns_of(registry) == {}


def test_rare_attributes_are_omitted_and_counted(registry: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns_module, "MAX_COLUMNS", 2)
    registry.put_asset("a", [thing("x", {"b": 1, "c": 1, "a": 1}), thing("y", {"c": 1})])
    index = registry.attribute_index()
    assert [row["name"] for row in index["attributes"]] == ["class", "asset", "a", "c"]
    assert index["left_out"] == 1
    assert {document["name"] for document in columns_of(registry).values()} == {"class", "asset", "a", "c"}


@pytest.fixture
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents_module, "OBJECTS_PER_COLUMN_SHARD", 8)
    monkeypatch.setattr(documents_module, "MAX_WHOLE_COLUMN", 20)


@pytest.mark.usefixtures("small_shards")
@pytest.mark.parametrize(("count", "whole"), [(20, True), (21, False), (100, False)])
def test_the_shards_of_a_large_column_hold_the_values_of_the_whole(registry: Registry, count: int, whole: bool) -> None:
    values = [(7 * k) % 31 for k in range(count)]
    ids = registry.put_asset("a", [thing(str(k), {"v": value}) for k, value in enumerate(values)]).tolist()
    key = column_key("attributes", "v")
    documents = {name: document for name, document in columns_of(registry).items() if name.startswith(key)}
    if whole:
        assert documents.keys() == {key}
        assert column_of(registry, "v") == dict(zip(ids, values, strict=True))
        return
    summary = documents.pop(key)
    assert (summary["version"], summary["shard_size"], summary["objects"]) == (2, 8, count)
    assert summary["shards"] == sorted({number // 8 for number in ids})
    assert documents.keys() == {f"{key}/{shard}" for shard in summary["shards"]}
    found: dict[int, int] = {}
    for document in documents.values():
        assert {number // 8 for number in document["ids"]} == {document["shard"]}
        found |= dict(zip(document["ids"], document["values"], strict=True))
    assert found == dict(zip(ids, values, strict=True))
    assert dict(summary["values"]) == Counter(values)
    assert [n for _, n in summary["values"]] == sorted(Counter(values).values(), reverse=True)


@pytest.mark.usefixtures("small_shards")
def test_a_summary_samples_numbers_evenly_also_from_text(registry: Registry) -> None:
    registry.put_asset(
        "a", [thing(str(k), {"n": k / 2, "t": f" {k} ", "x": "12" if k else "twelve", "b": k % 2 == 0, "e": "1_0"}) for k in range(2001)]
    )
    columns = columns_of(registry)
    numbers = {name: columns[column_key("attributes", name)].get("numbers") for name in "ntxbe"}
    assert numbers["n"] == list(range(1001))
    assert numbers["t"] == [2 * k for k in range(1001)]
    assert (numbers["x"], numbers["b"], numbers["e"]) == (None, None, None)


@pytest.mark.usefixtures("small_shards")
def test_shards_hold_inherited_values_of_far_ancestors(registry: Registry) -> None:
    registry.put_asset("a", [thing("house", {"year": 1900}), *(thing(str(k), {}, 0) for k in range(40))])
    columns = columns_of(registry)
    key = column_key("attributes", "year")
    assert columns[key]["objects"] == 41
    assert all(value == 1900 for shard in columns[key]["shards"] for value in columns[f"{key}/{shard}"]["values"])

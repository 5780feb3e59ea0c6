"""Ids, shards and the search index."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from map3d.errors import LimitExceeded
from map3d.registry import NewObject, Registry
from map3d.registry.registry import MAX_ID
from map3d.types import Box

UNIT: Box = ((0.0, 0.0, 0.0), (2.0, 4.0, 6.0))


@pytest.fixture
def registry(tmp_path: Path) -> Iterator[Registry]:
    with Registry(tmp_path / "registry.sqlite") as opened:
        yield opened


def things(*names: str) -> list[NewObject]:
    return [NewObject(name, "building", box=UNIT) for name in names]


def search_of(registry: Registry) -> dict[str, Any]:
    ((name, data),) = registry.search_documents()
    assert name == "objects/search.json"
    document: dict[str, Any] = json.loads(data)
    return document


def test_ids_are_positive_and_unique_across_assets(registry: Registry) -> None:
    first = registry.put_asset("a", things("x", "y"))
    second = registry.put_asset("b", things("x", "y"))
    ids = [*first.tolist(), *second.tolist()]
    assert len(set(ids)) == 4
    assert min(ids) > 0
    assert first.dtype == "uint32"


def test_ids_survive_reimports_in_any_order(registry: Registry) -> None:
    before = dict(zip("xyz", registry.put_asset("a", things("x", "y", "z")).tolist(), strict=True))
    after = dict(zip("zwx", registry.put_asset("a", things("z", "w", "x")).tolist(), strict=True))
    assert (after["x"], after["z"]) == (before["x"], before["z"])
    assert after["w"] not in before.values()
    assert registry.get(before["y"]) is None
    assert registry.count() == 3


def test_an_object_of_a_removed_asset_keeps_nothing_but_its_name_and_id(registry: Registry) -> None:
    parent, child = (int(number) for number in registry.put_asset("a", [*things("x"), NewObject("y", "part", parent=0, attributes={"owner": "Ada"})]))
    registry.remove_assets(["a"])
    registry.remove_assets(["a"])
    assert registry.count() == 0
    assert registry.get(parent) is None
    assert list(registry.shards()) == []
    with registry._database.reading() as db:
        rows = [tuple(row) for row in db.execute("SELECT id, asset, name, occurrence, class, parent, lod, attributes, present, x0 FROM object")]
    assert rows == [(parent, "a", "x", 0, "", None, None, "{}", 0, None), (child, "a", "y", 0, "", None, None, "{}", 0, None)]


def test_objects_of_a_removed_asset_that_return_get_their_ids_back_and_others_do_not(registry: Registry) -> None:
    before = registry.put_asset("a", things("x", "x", "y")).tolist()
    registry.remove_assets(["a"])
    other = registry.put_asset("b", things("x", "x", "y")).tolist()
    after = registry.put_asset("a", things("new", "y", "x", "x")).tolist()
    assert after[1:] == [before[2], before[0], before[1]]
    assert len({*before, *other, after[0]}) == 7
    assert registry.get(before[0]) == registry.get(after[2])


def test_an_object_that_returns_gets_its_id_back(registry: Registry) -> None:
    (first,) = registry.put_asset("a", things("x"))
    registry.put_asset("a", [])
    assert registry.count() == 0
    (other,) = registry.put_asset("a", things("y"))
    (again,) = registry.put_asset("a", things("x"))
    assert first == again != other


def test_objects_with_the_same_name_have_different_ids(registry: Registry) -> None:
    ids = registry.put_asset("a", things("x", "x", "x"))
    assert len(set(ids.tolist())) == 3
    assert registry.put_asset("a", things("x", "x", "x")).tolist() == ids.tolist()


def test_a_parents_box_contains_its_children(registry: Registry) -> None:
    parts = [
        NewObject("part", "building", parent=1, box=((1.0, 1.0, 1.0), (9.0, 2.0, 2.0))),
        NewObject("whole", "building"),
        NewObject("door", "opening", parent=0, box=((-5.0, 1.0, 1.0), (0.0, 2.0, 2.0))),
    ]
    part, whole, _ = registry.put_asset("a", parts).tolist()
    found = registry.get(whole)
    assert found is not None
    assert found.box == ((-5.0, 1.0, 1.0), (9.0, 2.0, 2.0))
    inner = registry.get(part)
    assert inner is not None
    assert inner.parent == whole


def test_a_cycle_of_parents_terminates(registry: Registry) -> None:
    ring = [NewObject("a", "building", parent=1, box=UNIT), NewObject("b", "building", parent=0)]
    ids = registry.put_asset("a", ring).tolist()
    assert [registry.get(number) is not None for number in ids] == [True, True]


def test_shards_contain_1024_ids_each(registry: Registry) -> None:
    registry.put_asset("a", [NewObject(f"n{k}", "tree") for k in range(2500)])
    documents = list(registry.shards())
    assert [document["shard"] for document in documents] == registry.shard_numbers() == [0, 1, 2]
    assert all(int(key) // 1024 == document["shard"] for document in documents for key in document["objects"])
    assert sum(len(document["objects"]) for document in documents) == 2500 == registry.count() == len(list(registry.objects()))
    assert registry.shard(77) == {"map3d": "objects", "version": 1, "shard": 77, "objects": {}}


def test_a_shard_matches_the_specification(registry: Registry) -> None:
    attributes = {"roofType": "1000", "height": 12.5, "storeys": 3, "new": True, "none": None, "bad": float("nan"), "list": [1, "é"]}
    (number,) = registry.put_asset("a", [NewObject("x", "building", attributes=attributes, box=UNIT)]).tolist()
    assert registry.shard(0)["objects"][str(number)] == {
        "name": "x",
        "class": "building",
        "parent": None,
        "asset": "a",
        "box": [[0.0, 0.0, 0.0], [2.0, 4.0, 6.0]],
        "attributes": {**attributes, "bad": None, "list": '[1, "é"]'},
    }


def test_shards_name_the_children_of_objects(registry: Registry) -> None:
    parts = [NewObject(f"part {k}", "building", parent=0) for k in range(3)]
    town = [
        NewObject("hall", "building", box=UNIT),
        *parts,
        NewObject("dormer", "building", parent=2),
        *(NewObject(f"n{k}", "tree") for k in range(1500)),
    ]
    ids = registry.put_asset("a", town).tolist()
    # The last part is new: its id is far from its parent's, in another shard.
    ids = [*registry.put_asset("a", [*town, NewObject("part 3", "building", parent=0)]).tolist()]
    for shards in (list(registry.shards()), [registry.shard(number) for number in registry.shard_numbers()]):
        objects = {int(key): entry for document in shards for key, entry in document["objects"].items()}
        assert {number: entry["children"] for number, entry in objects.items() if "children" in entry} == {
            ids[0]: [*ids[1:4], ids[-1]],
            ids[2]: [ids[4]],
        }
        assert all(objects[child]["parent"] == number for number, entry in objects.items() for child in entry.get("children", ()))
    assert ids[0] // 1024 != ids[-1] // 1024


def test_the_search_index_is_sorted_by_label_then_id(registry: Registry) -> None:
    objects = [
        NewObject("b", "building", box=UNIT),
        NewObject("a", "building", attributes={"address": "Street 5"}, box=UNIT),
        NewObject("c", "building"),
    ]
    b, a, _ = registry.put_asset("x", objects).tolist()
    (b2,) = registry.put_asset("y", things("b")).tolist()
    top = [1.0, 2.0, 6.0]
    assert search_of(registry) == {"map3d": "search", "version": 1, "entries": [[a, "a, Street 5", top], [b, "b", top], [b2, "b", top]]}


@pytest.mark.parametrize(
    ("attributes", "label"),
    [
        ({}, "id1"),
        ({"address": "Street 5"}, "id1, Street 5"),
        ({"name": "St. Martin", "address": "Square 1"}, "St. Martin, Square 1"),
        ({"name": "id1", "address": "  "}, "id1"),
        ({"name": 5, "address": None}, "id1"),
    ],
)
def test_labels_combine_name_and_address(registry: Registry, attributes: dict[str, object], label: str) -> None:
    registry.put_asset("a", [NewObject("id1", "building", attributes=attributes, box=UNIT)])
    assert search_of(registry)["entries"][0][1] == label


def test_ids_end_at_the_maximum(registry: Registry) -> None:
    with registry._database.transaction() as db:
        db.execute("INSERT INTO object(id, asset, name, occurrence, class, attributes, present) VALUES (?, 'z', 'z', 0, 'z', '{}', 0)", (MAX_ID,))
    with pytest.raises(LimitExceeded, match=str(MAX_ID)):
        registry.put_asset("a", things("x"))
    assert registry.count() == 0


def test_a_failed_import_leaves_the_earlier_objects(registry: Registry) -> None:
    registry.put_asset("a", things("x"))
    with pytest.raises(IndexError):
        registry.put_asset("a", [NewObject("y", "building", parent=5)])
    assert list(registry.ids_by_name("a")) == ["x"]


def test_a_scene_object_is_present_once_set(registry: Registry) -> None:
    ground = registry.get_or_create_scene_object("ground", "terrain")
    assert registry.get_or_create_scene_object("ground", "terrain") == ground
    assert registry.count() == 0
    registry.set_scene_object(ground, UNIT)
    assert registry.count() == 1
    registry.set_scene_object(ground, None)
    assert registry.get(ground) is None

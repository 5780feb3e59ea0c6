"""The search index: words, pages, and what a reader finds with few of them."""

import json
import random
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from map3d.registry import NewObject, Registry, search_index
from map3d.registry.kinds import kind_words
from map3d.registry.search_index import MAX_PAGE_BYTES
from map3d.registry.words import search_words
from map3d.types import Box

UNIT: Box = ((0.0, 0.0, 0.0), (2.0, 4.0, 6.0))
VECTORS = Path(__file__).parents[2] / "spec" / "vectors" / "search.json"
STREETS = ["Hauptstraße", "Am Markt", "Écluse", "Marktplatz", "St.-Martin-Weg", "Rue de l'Église", "大通り"]

Documents = Mapping[str, bytes]


@pytest.fixture
def small_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search_index, "MIN_PAGE_BYTES", 300)
    monkeypatch.setattr(search_index, "MAX_PAGE_BYTES", 800)
    monkeypatch.setattr(search_index, "CUT_EVERY", 4)


@pytest.fixture
def registry(tmp_path: Path) -> Iterator[Registry]:
    with Registry(tmp_path / "registry.sqlite") as opened:
        yield opened


def put(registry: Registry, labels: list[str]) -> dict[int, str]:
    """Registers objects with these labels. Returns the labels by id."""
    ids = registry.put_asset("a", [NewObject(label, "building", box=UNIT) for label in labels])
    return dict(zip(ids.tolist(), labels, strict=True))


def labels_of(count: int) -> list[str]:
    drawn = random.Random(7)
    return [f"{drawn.choice(STREETS)} {drawn.randrange(200)}, DEBY_LOD2_{4_000_000 + k}" for k in range(count)]


class Reader:
    """Reads an index as spec/manifest.md says, independently of the code that wrote it."""

    def __init__(self, documents: Documents) -> None:
        self._documents = documents
        self.read: list[str] = []

    def find(self, beginning: str) -> dict[int, str]:
        """Returns the entries of all pages that may hold a key with this beginning."""
        return self._descend("objects/search.json", beginning)

    def _descend(self, name: str, beginning: str) -> dict[int, str]:
        self.read.append(name)
        page: dict[str, Any] = json.loads(self._documents[name])
        assert page["map3d"] == "search"
        if "entries" in page:
            return {number: label for number, label, *_ in page["entries"]}
        keys = [utf16(key) for key in page["keys"]]
        sought = utf16(beginning)
        assert keys == sorted(keys)
        first = max((k for k, key in enumerate(keys) if key < sought), default=0)
        chosen = [k for k in range(len(keys)) if k == first or (k > first and keys[k].startswith(sought))]
        found: dict[int, str] = {}
        for k in chosen:
            found |= self._descend(f"objects/search/{page['pages'][k]}.json", beginning)
        return found


def utf16(text: str) -> bytes:
    return text.encode("utf-16-be")


@pytest.mark.parametrize("row", json.loads(VECTORS.read_text()), ids=lambda row: row["text"])
def test_words_match_the_vectors(row: dict[str, Any]) -> None:
    assert search_words(row["text"]) == row["words"]


@pytest.mark.usefixtures("small_pages")
@pytest.mark.parametrize("beginning", ["haupt", "hauptstrasse 1", "markt", "am markt 17", "4000123", "deby lod2 40001", "egl", "大", "zzz", "a", ""])
def test_every_label_with_a_beginning_is_on_the_pages_that_a_reader_chooses(registry: Registry, beginning: str) -> None:
    labels = put(registry, labels_of(500))
    found = Reader(dict(registry.search_documents())).find(beginning)
    expected = {number for number, label in labels.items() if f" {' '.join(search_words(label))}".find(f" {beginning}") >= 0}
    assert expected <= found.keys()
    assert all(labels[number] == label for number, label in found.items())


@pytest.mark.usefixtures("small_pages")
def test_house_numbers_are_no_beginnings_except_at_the_start(registry: Registry) -> None:
    labels = put(registry, [*(f"Hauptstraße {k % 200}a" for k in range(400)), "17 Columns"])
    assert {labels[number] for number in Reader(dict(registry.search_documents())).find("17 ")} >= {"17 Columns"}
    assert "Hauptstraße 17a" in Reader(dict(registry.search_documents())).find("hauptstrasse 17a").values()


@pytest.mark.usefixtures("small_pages")
def test_a_reader_fetches_a_path_of_the_tree(registry: Registry) -> None:
    put(registry, labels_of(500))
    documents = dict(registry.search_documents())
    assert len(documents) > 200
    reader = Reader(documents)
    reader.find("4000123")
    assert len(reader.read) <= 6
    assert json.loads(documents["objects/search.json"])["version"] == 2
    assert all(len(data) < 800 + 200 for data in documents.values())


@pytest.mark.usefixtures("small_pages")
@pytest.mark.parametrize(
    "labels", [["same"] * 400, [f"same {k // 100}" for k in range(400)], ["", "!?", *["x y z"] * 90], ["x" * 500 + str(k) for k in range(50)]]
)
def test_equal_and_empty_keys_are_found(registry: Registry, labels: list[str]) -> None:
    by_id = put(registry, labels)
    documents = dict(registry.search_documents())
    for beginning in {" ".join(search_words(label))[:48] for label in labels}:
        expected = {number for number, label in by_id.items() if " ".join(search_words(label)).startswith(beginning)}
        assert expected <= Reader(documents).find(beginning).keys()


@pytest.mark.usefixtures("small_pages")
@pytest.mark.parametrize("letters", ["\ue000\U00010400\uffdcz", "\U00010400\U00010401\U0001f600a"])
def test_pages_are_ordered_like_javascript_strings(registry: Registry, letters: str) -> None:
    by_id = put(registry, [a + b + c for a in letters for b in letters for c in letters] * 2)
    documents = dict(registry.search_documents())
    for number, label in by_id.items():
        assert number in Reader(documents).find(" ".join(search_words(label)))


def test_an_index_of_one_page_is_one_document_of_version_1(registry: Registry) -> None:
    put(registry, labels_of(300))
    ((name, data),) = registry.search_documents()
    document = json.loads(data)
    assert (name, document["version"]) == ("objects/search.json", 1)
    assert [label for _, label, *_ in document["entries"]] == sorted(labels_of(300))


def test_pages_are_bounded_and_named_by_their_content(registry: Registry) -> None:
    put(registry, labels_of(4000))
    documents = dict(registry.search_documents())
    assert len(documents) > 8
    assert max(map(len, documents.values())) < MAX_PAGE_BYTES + 1024
    assert dict(registry.search_documents()) == documents


@pytest.mark.parametrize("change", [lambda labels: labels[1:], lambda labels: ["Aachener Str. 1", *labels], lambda labels: [*labels[:-1], "Zoo"]])
def test_a_changed_label_changes_few_pages(registry: Registry, change: Callable[[list[str]], list[str]]) -> None:
    labels = labels_of(6000)
    put(registry, labels)
    before = dict(registry.search_documents())
    put(registry, change(labels))
    after = dict(registry.search_documents())
    assert len(before) > 20
    assert len(after.keys() - before.keys()) <= 5 * 2
    assert all(before[name] == after[name] for name in before.keys() & after.keys() if name != "objects/search.json")


def entries_of(registry: Registry) -> dict[int, list[Any]]:
    ((_, data),) = registry.search_documents()
    return {entry[0]: entry for entry in json.loads(data)["entries"]}


@pytest.mark.parametrize(
    ("name", "attributes", "label"),
    [
        ("DEBY_LOD2_4959323", {"name": "Dom", "address": "Platz 1"}, "Dom, Platz 1"),
        ("DEBY_LOD2_4959323", {"address": "Platz 1"}, "Platz 1"),
        ("UUID_d281adfc-4901", {"function": "Kirche", "name": "b_77"}, "Kirche"),
        ("UUID_d281adfc-4901", {"function": "1000"}, "building"),
        ("Town hall 100", {}, "Town hall 100"),
    ],
)
def test_a_label_is_what_people_say_and_never_an_identifier(registry: Registry, name: str, attributes: dict[str, Any], label: str) -> None:
    (number,) = registry.put_asset("a", [NewObject(name, "building", attributes=attributes, box=UNIT)]).tolist()
    entry = entries_of(registry)[number]
    assert entry[1] == label
    assert set(search_words(name)) <= {word for text in (entry[1], *entry[3:]) for word in search_words(text)}


@pytest.mark.parametrize("function", ["church", "Kirchengebäude", "église", "Pfarrkirche"])
def test_a_kind_is_found_in_three_languages(registry: Registry, function: str) -> None:
    (number,) = registry.put_asset("a", [NewObject("x_1", "building", attributes={"function": function}, box=UNIT)]).tolist()
    assert {"church", "kirche", "eglise"} <= {
        word for text in (entries_of(registry)[number][1], entries_of(registry)[number][3]) for word in search_words(text)
    }


@pytest.mark.parametrize("function", ["sports hall", "bus station", "Bürgerhaus", "31001_1000", "tourism"])
def test_words_of_other_kinds_mean_no_kind(function: str) -> None:
    assert not {"town", "gare", "castle", "tower"} & set(kind_words("building", {"function": function}))


@pytest.mark.usefixtures("small_pages")
def test_the_names_of_parts_lead_to_their_building(registry: Registry) -> None:
    put(registry, labels_of(400))
    building = NewObject("b_1", "building", box=UNIT)
    parts = [
        NewObject("p_1", "building_part", parent=0, attributes={"name": "Nordturm"}, box=UNIT),
        NewObject("w_1", "window", parent=1, attributes={"name": "Rose"}, box=UNIT),
    ]
    number, *inner = registry.put_asset("b", [building, *parts]).tolist()
    for beginning in ("nordturm", "rose", "p 1"):
        found = Reader(dict(registry.search_documents())).find(beginning)
        assert found[number] == "Nordturm"
        assert not found.keys() & set(inner)


def test_an_object_with_countless_parts_has_an_entry_of_bounded_size(registry: Registry) -> None:
    parts = [NewObject(f"part{k}_x", "building_part", parent=0, box=UNIT) for k in range(2000)]
    registry.put_asset("a", [NewObject("Whole", "building", box=UNIT), *parts])
    (entry,) = entries_of(registry).values()
    assert len(entry[3]) < 200

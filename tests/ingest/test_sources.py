"""Search for source documents, and the names of their assets."""

from pathlib import Path

import pytest

from map3d.errors import NotFound, UnknownFormat
from map3d.ingest.asset_names import asset_name
from map3d.ingest.sources import find_sources, source_digest

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def other(path: object) -> str:
    """Returns an OBJ that no other path has: equal ones are read once."""
    return f"{OBJ}# {path}\n"


def fill(folder: Path) -> Path:
    for name in ("b.obj", "a/b.obj", "a/B.obj", "c d.obj"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(other(name))
    (folder / "b.mtl").write_text("newmtl x\n")
    (folder / "notes.odt").write_text("nothing to read")
    (folder / ".hidden.obj").write_text(OBJ)
    for name in ("terrain/dem.tif", "terrain/ortho.tif"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(b"II*\0" + name.encode())
    return folder


def test_a_folder_yields_every_readable_file_once_in_order(tmp_path: Path) -> None:
    found = find_sources([fill(tmp_path)])
    assert [(source.name, source.format) for source in found] == [("b", "obj"), ("b-2", "obj"), ("b-3", "obj"), ("c-d", "obj"), ("terrain", "raster")]
    assert [path.name for path in found[-1].paths] == ["dem.tif", "ortho.tif"]
    assert find_sources([tmp_path]) == found


def names(folder: Path, known: dict[str, Path] | None = None) -> dict[str, str]:
    """Returns relative path → name."""
    return {str(source.paths[0].relative_to(folder)): source.name for source in find_sources([folder], known=known)}


@pytest.mark.parametrize("added", ["a/town.obj", "a/TOWN.obj", "a.obj", "town.obj", "b/c/town.obj"])
def test_known_files_keep_their_names_when_others_are_added(tmp_path: Path, added: str) -> None:
    for path in ("b/town.obj", "c/town.obj", added):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
    for path in ("b/town.obj", "c/town.obj"):
        (tmp_path / path).write_text(other(path))
    before = names(tmp_path)
    assert before == {"b/town.obj": "town", "c/town.obj": "town-2"}
    known = {name: tmp_path / path for path, name in before.items()}
    (tmp_path / added).write_text(other(added))
    after = names(tmp_path, known)
    assert after == before | {added: "a" if added == "a.obj" else "town-3"}

    moved = tmp_path.with_name(f"{tmp_path.name}-moved")
    tmp_path.rename(moved)
    assert names(moved, {name: tmp_path / path for path, name in after.items()}) == after
    (moved / "b/town.obj").unlink()
    assert names(moved, {name: moved / path for path, name in after.items()}) == {path: name for path, name in after.items() if path != "b/town.obj"}


def test_a_file_of_a_numbered_asset_given_alone_is_that_asset(tmp_path: Path) -> None:
    known = {"town": tmp_path / "b" / "town.obj", "town-2": tmp_path / "c" / "town.obj"}
    for path in known.values():
        path.parent.mkdir()
        path.write_text(OBJ)
    assert [source.name for source in find_sources([known["town-2"]], known=known)] == ["town-2"]
    assert [source.name for source in find_sources([known["town-2"]], "town", known=known)] == ["town"]


def given(path: Path, known: dict[str, Path]) -> str:
    """Returns the name of a document that is given itself, where all known names are taken."""
    (source,) = find_sources([path], known=known, taken=list(known))
    return source.name


def test_a_given_file_of_another_folder_has_a_name_of_its_own_and_keeps_it(tmp_path: Path) -> None:
    paths = [tmp_path / folder / "town.obj" for folder in ("b", "c", "x/c", "y/x/c")]
    known: dict[str, Path] = {}
    for path, name in zip(paths, ("town", "c-town", "x-c-town", "y-x-c-town"), strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(OBJ)
        assert given(path, known) == name
        known[name] = path
    assert [given(path, known) for path in paths] == list(known)
    (tmp_path / "link").symlink_to(tmp_path / "c")
    assert given(tmp_path / "link" / "town.obj", known) == "c-town", "the same file by another path"
    assert [source.name for source in find_sources(list(reversed(paths)), known=known, taken=list(known))] == list(reversed(known))
    assert [source.name for source in find_sources([paths[1]], known={"town": paths[0]})] == ["town"], "a name that is not taken"
    assert [source.name for source in find_sources([paths[1]], "town", known=known, taken=list(known))] == ["town"], "--name"


def test_names_of_deep_folders_stay_within_the_longest_name(tmp_path: Path) -> None:
    known: dict[str, Path] = {}
    for folder in ("first", "f" * 70, "g" * 70):
        path = tmp_path / folder / f"{'t' * 50}.obj"
        path.parent.mkdir()
        path.write_text(OBJ)
        name = given(path, known)
        assert len(name) <= 64
        assert name not in known
        known[name] = path
    assert list(known) == ["t" * 50, f"{'t' * 50}-2", f"{'t' * 50}-3"]


def test_a_folder_without_a_readable_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("v 1 2 3")
    with pytest.raises(UnknownFormat, match="no readable file in this folder;"):
        find_sources([tmp_path])
    (tmp_path / "town.zip").write_bytes(b"PK\x03\x04")
    with pytest.raises(UnknownFormat, match=r"no readable file in this folder \(found .*town.zip: a ZIP archive; unpack it first\);"):
        find_sources([tmp_path])


def test_unreadable_files_with_a_known_suffix_are_reported(tmp_path: Path) -> None:
    fill(tmp_path)
    for name, data in (("a/empty.gml", b""), ("words.OBJ", b"no lines of an OBJ"), ("page.xml", b"<html/>"), ("data.json", b"{}")):
        (tmp_path / name).write_bytes(data)
    reported: list[tuple[str, str]] = []
    found = find_sources([tmp_path], None, lambda path, why: reported.append((path.name, str(why))))
    assert len(found) == 5
    assert [name for name, _ in reported] == ["empty.gml", "words.OBJ"]
    assert [why.partition(";")[0].rpartition(": ")[2] for _, why in reported] == ["an empty file", "a file of unknown format"]


def test_code_lists_that_a_file_names_are_listed_as_used(tmp_path: Path) -> None:
    (tmp_path / "udx").mkdir()
    (tmp_path / "codelists").mkdir()
    uses = "".join(f"<usage codeSpace='../codelists/{name}'>1</usage>" for name in ("used.xml", "Named%20so.gml", "../../outside.xml"))
    (tmp_path / "udx" / "town.gml").write_text(f"<CityModel>{uses}</CityModel>")
    for name in ("used.xml", "Named so.gml", "unused.xml"):
        (tmp_path / "codelists" / name).write_text("<gml:Dictionary/>")
    reported: dict[str, str] = {}
    report = lambda path, note: reported.update({path.name: note.code})  # noqa: E731
    (found,) = find_sources([tmp_path], None, report, report)
    used = dict.fromkeys(("used.xml", "Named so.gml"), "used-as-code-list")
    assert (found.name, reported) == ("town", used | {"unused.xml": "format-ignored"})
    before = source_digest(found)
    (tmp_path / "codelists" / "used.xml").write_text("<gml:Dictionary gml:id='a'/>")
    assert source_digest(found) != before


def test_a_given_file_of_unknown_format_is_refused(tmp_path: Path) -> None:
    fill(tmp_path)
    with pytest.raises(UnknownFormat, match=r"notes\.odt"):
        find_sources([tmp_path / "b.obj", tmp_path / "notes.odt"])
    with pytest.raises(NotFound):
        find_sources([tmp_path / "nothing.obj"])


def test_a_given_name_is_used(tmp_path: Path) -> None:
    assert [source.name for source in find_sources([fill(tmp_path) / "b.obj"], "Mein Haus")] == ["mein-haus"]


@pytest.mark.parametrize(
    ("text", "name"), [("LoD2_32_691", "lod2_32_691"), ("Käse & Brot.v2", "k-se-brot-v2"), ("--", "asset"), ("a" * 99, "a" * 64), ("_x", "x")]
)
def test_asset_names_contain_only_valid_characters(text: str, name: str) -> None:
    assert asset_name(text) == name


def test_the_source_digest_covers_document_and_materials(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("mtllib other.mtl\n" + OBJ)
    (source,) = find_sources([path])
    seen = {source_digest(source)}
    (tmp_path / "other.mtl").write_text("newmtl x\n")
    seen.add(source_digest(source))
    (tmp_path / "unrelated.obj").write_text(other("unrelated"))
    assert source_digest(source) in seen
    path.write_text("mtllib other.mtl\n" + OBJ + "f 3 2 1\n")
    seen.add(source_digest(source))
    assert len(seen) == 3


def digest_of(path: Path) -> str:
    (source,) = find_sources([path])
    return source_digest(source)


def test_the_source_digest_covers_only_referenced_images(tmp_path: Path) -> None:
    textures = tmp_path / "textures"
    textures.mkdir()
    for name in ("wall & roof.jpg", "door.png", "other.jpg"):
        (textures / name).write_bytes(b"before")
    (tmp_path.parent / "outside.jpg").write_bytes(b"before")
    (tmp_path / "a.obj").write_text("mtllib lib/m.mtl\n" + OBJ)
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "m.mtl").write_text("newmtl x\nmap_Kd -clamp on door.png\n")
    (tmp_path / "lib" / "door.png").write_bytes(b"before")
    named = "".join(
        f"<app:imageURI> {uri} </app:imageURI>" for uri in ("textures/wall &amp; roof.jpg", "textures\\door.png", "../outside.jpg", "none.png")
    )
    (tmp_path / "b.gml").write_text(f"<CityModel>{named}</CityModel>")
    for image, documents in (
        (textures / "wall & roof.jpg", {"b.gml"}),
        (textures / "door.png", {"b.gml"}),
        (tmp_path / "lib" / "door.png", {"a.obj"}),
        (tmp_path / "lib" / "m.mtl", {"a.obj"}),
        (textures / "other.jpg", set()),
        (tmp_path.parent / "outside.jpg", set()),
    ):
        before = {name: digest_of(tmp_path / name) for name in ("a.obj", "b.gml")}
        image.write_bytes(image.read_bytes() + b"after")
        assert {name for name in before if digest_of(tmp_path / name) != before[name]} == documents, image

"""The page `report.html` of a publication: what `map3d site` found in the files, as HTML without scripts, for any static host."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Final

from map3d.formats import title_of
from map3d.ingest.file_notes import tag
from map3d.ingest.findings import Finding
from map3d.messages import message
from map3d.publish.page_head import MAX_TITLE, add_policy, cut
from map3d.quantities import plural, size_text, time_text
from map3d.registry import ObjectKind
from map3d.scenes.file_contents import FileContents, file_label, findings_of, sum_kinds
from map3d.scenes.outlier_lines import box_text, extent_text
from map3d.site.report import SiteReport

REPORT_PAGE: Final = "report.html"
REPORT_STYLE: Final = "report.css"
MAX_ROWS: Final = 2000
MAX_KINDS: Final = 12
MAX_EXAMPLE: Final = 400

_NOT_FOUND: Final = message("image-file-not-found")
_STYLE_PATH: Final = Path(__file__).with_name(REPORT_STYLE)
_PAGE: Final = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}: import report</title>
<link rel="icon" href="favicon.ico">
<link rel="stylesheet" href="report.css">
</head>
<body>
{body}
</body>
</html>
"""


def report_files(report: SiteReport, images: int, size: int, picture: str | None) -> Iterator[tuple[str, bytes]]:
    """Yields the page and its style sheet. `images`, `size`: number and bytes of the published tiles; `picture`: URL of a picture of the map."""
    yield REPORT_STYLE, _STYLE_PATH.read_bytes()
    yield REPORT_PAGE, report_page(report, images, size, picture).encode()


def report_page(report: SiteReport, images: int, size: int, picture: str | None = None) -> str:
    parts = [
        _head(report, picture),
        _figures(report, images, size),
        _scene(report, images, size),
        _problems(report),
        _left_out(report),
        _others(report),
        _files(report.files),
        '<footer>Made with map3d. <a href="index.html">Open the map</a></footer>',
    ]
    return add_policy(_PAGE.format(title=escape(cut(report.title, MAX_TITLE)), body="\n".join(part for part in parts if part)))


def _head(report: SiteReport, picture: str | None) -> str:
    image = "" if picture is None else f'<img src="{escape(picture)}" alt="" width="1200" height="630">'
    title = f'<h1>{escape(cut(report.title, MAX_TITLE))}</h1><p class="note">Import report</p>'
    return f'<header>{image}<div>{title}</div><a class="button" href="index.html">Open the map</a></header>'


def _figures(report: SiteReport, images: int, size: int) -> str:
    """Returns the most important numbers in large type."""
    named = [file.textures for file in report.files if file.textures is not None]
    missing = sum(textures.missing for textures in named)
    skipped = sum(file.skipped for file in report.files)
    cells = [
        (
            "file imported" if len(report.files) == 1 else "files imported",
            f"{len(report.files):,}",
            f"{len(report.failed):,} not imported" if report.failed else "",
        ),
        ("objects", f"{sum(file.objects for file in report.files):,}", ""),
        ("triangles", f"{sum(file.triangles for file in report.files):,}", f"{plural(skipped, 'element')} skipped" if skipped else ""),
        ("textures", f"{sum(textures.images for textures in named):,}", f"{missing:,} missing" if missing else ""),
        ("tile images", f"{images:,}", ""),
        ("size of the images", size_text(size), ""),
    ]
    rows = (f"<li><b>{value}</b> {name}{_note(note)}</li>" for name, value, note in cells)
    return f'<ul class="figures">{"".join(rows)}</ul>'


def _note(note: str) -> str:
    return f' <span class="bad">{note}</span>' if note else ""


def _scene(report: SiteReport, images: int, size: int) -> str:
    why = f", since {report.why}" if report.why else ""
    rows = [
        ("Place", report.place),
        ("Coordinate system", report.crs or "none"),
        ("Extent", "" if report.box is None else box_text(report.box)),
        ("Objects", _kinds_text(sum_kinds(report.files))),
        ("Resolution", f"{report.res_m:g} m per pixel{why}"),
        ("Views", f"{len(report.views)}: {', '.join(report.views)} (look-at angle and pitch in degrees)"),
        ("Tiles", f"{plural(images, 'image')} of tiles, in all views, layers and levels, {size_text(size)}"),
        ("Rendering", "" if report.seconds is None else f"took {time_text(report.seconds)} with {plural(report.workers, 'worker')}"),
    ]
    cells = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in rows if text)
    return f"<section><h2>The scene</h2><dl>{cells}</dl></section>"


def _problems(report: SiteReport) -> str:
    findings = findings_of(report.files)
    if not findings and not any(file.textures is not None and file.textures.missing for file in report.files):
        return '<section><h2>Warnings</h2><p class="good">Nothing in the imported files was skipped, and there are no warnings.</p></section>'
    missing = sum(file.textures.missing for file in report.files if file.textures is not None)
    names = (f"{file.source}: {file.textures.examples[0]}" for file in report.files if file.textures is not None and file.textures.examples)
    is_listed = any(finding.reason == _NOT_FOUND for finding in findings)
    textures = [Finding(_NOT_FOUND, missing, next(names, ""))] if missing and not is_listed else []
    rows = "".join(map(_finding_row, [*textures, *findings]))
    head = "<tr><th>What</th><th>Example</th></tr>"
    return f'<section><h2>Warnings</h2><table class="warnings"><thead>{head}</thead><tbody>{rows}</tbody></table></section>'


def _finding_row(finding: Finding) -> str:
    example = escape(cut(finding.example, MAX_EXAMPLE))
    return f'<tr><td>{escape(str(finding.message))}</td><td class="example">{example}</td></tr>'


def _left_out(report: SiteReport) -> str:
    if not report.left_out:
        return ""
    return f"<section><h2>Far from the rest</h2><pre>{escape(chr(10).join(report.left_out))}</pre></section>"


def _others(report: SiteReport) -> str:
    """Returns the files that are no documents of the map."""
    rows = [_other_row("not imported", "tag bad", file, reason) for file, reason in report.failed[:MAX_ROWS]]
    rows += [_other_row(tag(note), "tag", file, str(note)) for file, note in report.ignored[:MAX_ROWS]]
    if not rows:
        return ""
    return f'<section><h2>Files that are not in the map</h2><table class="others"><tbody>{"".join(rows)}</tbody></table></section>'


def _other_row(tag: str, style: str, file: str, reason: str) -> str:
    text = cut(reason.removeprefix(f"{file}: "), MAX_EXAMPLE)
    cells = f'<td>{escape(file.rsplit("/", 1)[-1])}</td><td class="example">{escape(text)}</td>'
    return f'<tr><td><span class="{style}">{tag}</span></td>{cells}</tr>'


def _files(files: Sequence[FileContents]) -> str:
    columns = ["File", "Objects", "Triangles", "Textures", "Extent", "Coordinates"]
    if any(file.skipped or file.outside for file in files):
        columns.append("Skipped")
    head = "".join(f"<th>{name}</th>" for name in columns)
    rows = "".join(_file_row(file, columns) for file in files[:MAX_ROWS])
    more = f"<p>and {plural(len(files) - MAX_ROWS, 'more file')}</p>" if len(files) > MAX_ROWS else ""
    return f'<section><h2>Files</h2><table class="files"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{more}</section>'


def _file_row(file: FileContents, columns: Sequence[str]) -> str:
    place = [escape(text) for text in (file.crs, file.place) if text]
    skipped = [plural(file.skipped, "element")] if file.skipped else []
    skipped += [f"{plural(file.outside, 'triangle')} far from the rest"] if file.outside else []
    extent = "nothing" if file.box is None else extent_text(file.box)
    cells = [
        f"<b>{escape(file_label(file))}</b><small>{_format_text(file)}, {size_text(file.bytes)}</small>",
        f"{file.objects:,}<small>{escape(_kinds_text(file.kinds))}</small>",
        f"{file.triangles:,}",
        _textures(file),
        extent,
        "<br>".join(place),
        "<br>".join(skipped),
    ]
    return "<tr>" + "".join(_file_cell(name, cell) for name, cell in zip(columns, cells, strict=False)) + "</tr>"


def _file_cell(name: str, cell: str) -> str:
    """Returns a cell; `data-name`: the label that replaces the heads of the columns on narrow screens."""
    return f'<td data-name="{name}"><div>{cell}</div></td>' if cell else "<td></td>"


def _textures(file: FileContents) -> str:
    if file.textures is None:
        return ""
    missing = file.textures.missing
    if not missing:
        return f"{file.textures.images:,}"
    names = ", ".join(file.textures.examples) + (", …" if missing > len(file.textures.examples) else "")
    return f'{file.textures.images:,} <span class="bad">{missing:,} missing</span><small>{escape(cut(names, MAX_EXAMPLE))}</small>'


def _format_text(file: FileContents) -> str:
    if file.rasters is None:
        return title_of(file.format)
    counts = ((file.rasters.elevation, "elevation"), (file.rasters.imagery, "imagery"))
    return " and ".join(f"{plural(count, 'raster')} of {what}" for count, what in counts if count)


def _kinds_text(kinds: Sequence[ObjectKind]) -> str:
    parts = [f"{kind.count:,} {kind.kind.replace('_', ' ')}{'' if kind.lod is None else f' (LoD {kind.lod})'}" for kind in kinds[:MAX_KINDS]]
    return ", ".join([*parts, "…"] if len(kinds) > MAX_KINDS else parts)

"""A scene of the library."""

from collections.abc import Mapping, Sequence
from datetime import date, datetime
from os import PathLike
from pathlib import Path
from typing import Any

from map3d.catalogue import AssetRecord, Catalogue, SceneRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.geometry.views import parse_view
from map3d.ingest.import_options import ImportOptions
from map3d.jobs.dead_workers import expire_dead_workers
from map3d.library.library_rendering import LibraryRendering, light_of
from map3d.library.on_progress import OnProgress, building
from map3d.lifecycle.create_rendering import check_rendering, create_rendering
from map3d.lifecycle.remove_files import find_files, is_built, remove_files
from map3d.lifecycle.remove_scene import find_scene, remove_scene
from map3d.messages import Message
from map3d.requests import CreateRendering
from map3d.requests.reading import ModelOffset
from map3d.scenes.build import build_if_stale
from map3d.scenes.outliers import Outliers, choose_content, read_outliers
from map3d.scenes.style import choose_style
from map3d.types import DataEncoding, ViewAngles

View = tuple[float, float] | str
"""(look-at angle, pitch) in degrees, or a view as text, such as "45-22.5"."""


class LibraryScene:
    """Get it from a workspace. It holds no data: every property asks the catalogue."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, name: str) -> None:
        self._workspace, self._catalogue, self.name = workspace, catalogue, name

    @property
    def record(self) -> SceneRecord:
        """Title, attribution, coordinate system, origin. Raises NotFound after the scene was removed."""
        return self._catalogue.scene(self.name)

    @property
    def files(self) -> list[AssetRecord]:
        """The imported files with their reports, ordered by name."""
        return self._catalogue.assets(self.name)

    def renderings(self) -> list[LibraryRendering]:
        return [LibraryRendering(self._workspace, self._catalogue, record.name) for record in self._catalogue.renderings(self.name)]

    def add_files(
        self,
        *files: str | PathLike[str],
        crs: str | None = None,
        name: str | None = None,
        axes: str = "auto",
        height_unit: str = "auto",
        up: str = "z",
        split: str = "file",
        unit: str = "auto",
        offset: tuple[float, float, float] | None = None,
        theme: str | None = None,
        lod: str | None = None,
        interiors: bool = False,
        at: str | None = None,
        transparency: str = "auto",
        elevation: Sequence[str] = (),
        max_error_m: float = 0.0,
        heights: str | None = None,
        clamp: Sequence[str] = (),
        strict: bool = False,
        parse_memory_bytes: int | None = None,
        parse_cpu_s: int | None = None,
        skip_unchanged: bool = False,
        progress: OnProgress | None = None,
    ) -> FilesImport:
        """Imports files, and all files in known formats of folders and ZIP archives; the options are those of `map3d add-files`.

        Returns what was imported with its
        reports, and which files failed for which reason. `skip_unchanged`: leaves files alone that are in the scene as they are.

        Raises NotFound, UnknownFormat, BadRequest; for a single file, and with `strict`, also ImportFailed, LimitExceeded, CrsError.
        """
        options = ImportOptions(
            crs=crs,
            name=name,
            axes=axes,
            height_unit=height_unit,
            up=up,
            split=split,
            unit=unit,
            offset=None if offset is None else ModelOffset(*offset),
            theme=theme,
            lod=lod,
            interiors=interiors,
            at=at,
            transparency=transparency,
            elevation=tuple(elevation),
            max_error_m=max_error_m,
            heights=heights,
            clamp=tuple(clamp),
            strict=strict,
            parse_memory_bytes=parse_memory_bytes,
            parse_cpu_s=parse_cpu_s,
            skip_unchanged=skip_unchanged,
            virtual_rasters=True,
        )

        def show(file: str, number: int, total: int, how_far: Message | None) -> None:
            if progress is not None:
                progress(f"importing {file}" + (f": {how_far}" if how_far else ""), number, total)

        paths = [Path(file) for file in files]
        return import_files(self._workspace, self._catalogue, self.name, paths, options, progress=show)

    @property
    def outliers(self) -> Outliers:
        """What the last build left out because it lies far from the rest, and the places of the files."""
        return read_outliers(self._workspace, self.name)

    def remove_files(self, *names: str, progress: OnProgress | None = None) -> list[str]:
        """Removes imported files by the names of their assets or by file name; builds the scene again if it was built. Returns the names of the
        removed assets. Raises NotFound, BadRequest while the scene is being changed or rendered."""
        self._expire_dead_workers()
        found = find_files(self._workspace, self._catalogue, self.name, names)
        remove_files(self._workspace, self._catalogue, found)
        if is_built(self._workspace, self._catalogue, self.name):
            self.build(progress=progress)
        return sorted({*found.names, *found.finished})

    def build(
        self,
        *,
        workers: int | None = None,
        max_memory_bytes: int | None = None,
        keep_outliers: bool | None = None,
        cluster: int | None = None,
        style: Mapping[str, Any] | None = None,
        progress: OnProgress | None = None,
    ) -> dict[str, Any] | None:
        """Builds the scene if its files have changed; returns the report, None if the scene is up to date. `keep_outliers`: content however far it
        is from the rest; `cluster`: number of the place to build, of several far from each other, 0 for the largest; `style`: colours of surfaces
        that have none, as in a style file; None leaves these choices as they are. Raises BadRequest for a scene without files, LimitExceeded."""
        choose_content(self._catalogue, self.name, keep_outliers, cluster)
        choose_style(self._catalogue, self.name, style)
        show, threads = building(progress), workers
        return build_if_stale(self._workspace, self._catalogue, self.name, threads=threads, max_memory_bytes=max_memory_bytes, progress=show)

    def create_rendering(
        self,
        name: str,
        *,
        views: Sequence[View] | None = None,
        directions: int | None = None,
        pitch: float | Sequence[float] = (),
        res_m: float | None = None,
        levels: int | None = None,
        layers: Sequence[str] | None = None,
        data: DataEncoding | None = None,
        tile_px: int = 256,
        title: str = "",
        attribution: str = "",
        window: tuple[float, float, float] | None = None,
        tiles: str | None = None,
        regrid: bool = False,
        progress: OnProgress | None = None,
        color: str = "webp",
        quality: int = 80,
        small: bool = False,
        time: datetime | None = None,
        sun: tuple[float, float] | None = None,
        day: date | None = None,
        radius_m: float | None = None,
        place: tuple[float, float] | None = None,
    ) -> LibraryRendering:
        """Builds the scene if its files have changed, and creates a rendering of it. `views`, or `directions` evenly spaced look-at angles (4 by
        default) at each `pitch` (45); `res_m` metres per pixel, or a number of `levels`. `layers`: each KIND or NAME=KIND; without them, color with
        normal, id and depth, as PNG layers for the `data` "png", as one layer of data tiles for "tile". `sun`: azimuth and elevation; `place`:
        latitude and longitude. The others are those of `map3d create-rendering`.

        Raises AlreadyExists, BadName, BadRequest.
        """
        request = CreateRendering(
            scene=self.name,
            name=name,
            views=() if views is None else tuple(view_angles(view) for view in views),
            directions=directions,
            pitch=tuple(pitch) if isinstance(pitch, Sequence) else (pitch,),
            res_m=res_m,
            levels=levels,
            window=window,
            layers=None if layers is None else tuple(layers),
            data=data,
            tile_px=tile_px,
            title=title,
            attribution=attribution,
            tiles=tiles,
            regrid=regrid,
            color=color,
            quality=quality,
            small=small,
            time=time,
            day=day,
            radius_m=radius_m,
            **light_of(sun, place),
        )
        check_rendering(self._catalogue, request)
        self.build(progress=progress)
        record = create_rendering(self._workspace, self._catalogue, request)
        return LibraryRendering(self._workspace, self._catalogue, record.name)

    def remove(self, *, with_renderings: bool = False) -> None:
        """Removes the scene with its files. Raises BadRequest when it has renderings, unless they go too, and while it is changed or rendered."""
        self._expire_dead_workers()
        found = find_scene(self._workspace, self._catalogue, self.name, with_renderings=with_renderings)
        remove_scene(self._workspace, self._catalogue, found)

    def _expire_dead_workers(self) -> None:
        for record in self._catalogue.renderings(self.name):
            expire_dead_workers(self._catalogue, record.name)

    def __repr__(self) -> str:
        return f"<map3d scene {self.name!r}>"


def view_angles(view: View) -> ViewAngles:
    """Raises BadRequest for a view that is not one."""
    return parse_view(view) if isinstance(view, str) else ViewAngles(float(view[0]), float(view[1]))

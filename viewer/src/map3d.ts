/** map3d: shows renderings of 3D city models. See README.md. */
export { Map3D, Map3D as Map, Map3D as map } from "./map/map";
export { ImageLayer, ImageLayer as imageLayer, type ImageLayerEvents, type ImageLayerOptions } from "./map/imageLayer";
export { Marker, Marker as marker, type MarkerEvents, type MarkerOptions } from "./overlay/marker";
export { Popup, Popup as popup, type PopupEvents, type PopupOptions } from "./overlay/popup";
/** @internal */
export { findHeight } from "./map/findPosition";
/** @internal */
export { plugins, getPlugin } from "./core/plugins";
export type { TooltipContent } from "./map/options";
export type { Corner } from "./core/corner";
export type { FilledOptionsOf, Option, OptionsOf } from "./core/options";
export { MapLayer, type Addable, type LayerHost } from "./core/mapLayer";
export { Evented, type FiredEvent, type Listener } from "./core/events";
export { DecodeError, DrawError, FetchError, ManifestError, Map3dError, UsageError } from "./core/errors";
export type { ClickEvent, FitOptions, HoverEvent, MapEvents, MapOptions } from "./map/options";
export type { Bounds } from "./map/cameras";
export type { AnyPosition, GroundPosition, ObjectPosition, Position } from "./core/position";
export type { ObjectStyle } from "./map/objectStyle";
export type { VisibleObject } from "./map/visibleObjects";
export type { Pick } from "./map/picker";
export type { TransitionFrame, ViewTransition } from "./map/viewTransition";
export type { VisibleDepths } from "./map/visibleDepths";
export type { EnableDragging, OverlayHost } from "./core/overlayHost";
export type { Box3, Vec2, Vec3 } from "./core/vec";
export type { Clip } from "./draw/depthMapping";
export type { BakedLight, CustomLayer, FrameContent, FrameState, LayerPass, Mode, Quad, TileAccess } from "./draw/drawer";
export type { DrawDepths, LightEstimator, Program } from "./draw/lightEstimator";
export type { Light } from "./geo/light";
export { readManifest, type LayerInfo, type ManifestJson, type Rendering, type View } from "./geo/manifest";
export type { Tile } from "./geo/frame";
export { HttpSource, type Source } from "./tiles/source";
export type { LayerKind, TileData } from "./tiles/tileData";
export { Archive, type ReadRange } from "./tiles/pmtiles";
export type { FetchFunction } from "./tiles/fetch";
export type { Attribute, AttributeInfo, AttributeValue, ColumnSummary, ObjectInfo, SearchEntry } from "./tiles/objects";
export { chooseUtcOffset, computeDaylight } from "./geo/daylight";

/** Version of the viewer, which reads manifests of version 1. */
export const version = "0.1.0";

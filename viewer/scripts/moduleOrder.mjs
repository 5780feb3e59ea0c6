/** Modules of the core in an order, found by trial, that puts similar code side by side: the bundle is 0.7 KB smaller gzipped. Modules that are not listed follow. */
export const MODULE_ORDER = [
  "core/lengths.ts", "geo/daylight.ts", "geo/light.ts", "map/cameraController.ts", "map/findPosition.ts", "core/gl.ts", "core/mapLayer.ts",
  "map/mapLight.ts", "tiles/objects.ts", "tiles/fetch.ts", "geo/camera.ts", "map/imageLayer.ts", "geo/geographic.ts", "geo/position.ts",
  "draw/drawStyle.ts", "ui/styles.ts", "tiles/queue.ts", "tiles/decoder.ts", "draw/webgl/idTable.ts", "draw/color.ts", "draw/drawer.ts",
  "draw/webgl/webglDrawer.ts", "map/compatibility.ts", "map/frameRenderer.ts", "map/frameLoop.ts", "draw/depthMapping.ts", "map/pointerEvents.ts",
  "map/relief.ts", "map/cameras.ts", "draw/canvas/mask.ts", "map/gestures.ts", "draw/webgl/shader.ts", "map/keyboard.ts",
  "draw/canvas/tileMosaic.ts", "draw/canvas/shadingOptions.ts", "ui/scaleBar.ts", "tiles/cache.ts", "tiles/cover.ts",
  "draw/webgl/offscreenTarget.ts", "tiles/layerTiles.ts", "draw/webgl/program.ts", "geo/manifest.ts", "map/viewport.ts", "draw/canvas/compositor.ts",
  "core/dataTile.ts", "geo/occupancy.ts", "overlay/popup.ts", "core/dom.ts", "overlay/positionedLayer.ts", "core/errors.ts", "core/vec.ts",
  "core/inflate.ts", "overlay/marker.ts", "map/picker.ts", "core/png.ts", "geo/shadows.ts", "map/map.ts", "draw/canvas/tilePictures.ts",
  "core/i18n.ts", "map/options.ts", "ui/attribution.ts", "map/layerPlan.ts", "geo/frame.ts", "draw/webgl/textures.ts", "core/retry.ts",
  "map/mapItems.ts", "tiles/source.ts", "core/events.ts", "core/position.ts", "core/shaders.ts", "core/check.ts", "map/depthGroups.ts",
  "draw/canvas/canvasDrawer.ts", "tiles/tileData.ts", "map/visibleObjects.ts", "ui/controls.ts", "core/network.ts", "tiles/pmtiles.ts",
  "core/features.ts", "draw/webgl/idTextures.ts", "draw/quads.ts", "map/motion.ts", "map/limits.ts", "tiles/url.ts", "map/neighbourViews.ts",
  "geo/axes.ts", "map/objectStyle.ts",
];

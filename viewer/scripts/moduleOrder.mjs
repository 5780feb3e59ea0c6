/** Modules of the core in an order, found by trial, that puts similar code side by side: the bundle is 0.7 KB smaller gzipped. Modules that are not listed follow. */
export const MODULE_ORDER = [
  "core/lengths.ts", "geo/daylight.ts", "geo/light.ts", "map/cameraController.ts", "map/findPosition.ts", "map/keyboard.ts", "map/relief.ts",
  "core/mapLayer.ts", "map/compatibility.ts", "map/mapLight.ts", "tiles/objects.ts", "tiles/fetch.ts", "map/imageLayer.ts", "tiles/queue.ts",
  "draw/drawStyle.ts", "geo/camera.ts", "tiles/decoder.ts", "draw/webgl/webglDrawer.ts", "tiles/tileData.ts", "core/network.ts", "map/frameLoop.ts",
  "geo/occupancy.ts", "geo/frame.ts", "core/features.ts", "draw/canvas/canvasDrawer.ts", "map/depthGroups.ts", "draw/webgl/textures.ts",
  "map/frameRenderer.ts", "draw/webgl/program.ts", "tiles/cache.ts", "map/pointerEvents.ts", "core/shaders.ts", "map/gestures.ts", "geo/manifest.ts",
  "ui/controls.ts", "map/objectStyle.ts", "tiles/layerTiles.ts", "ui/scaleBar.ts", "tiles/pmtiles.ts", "draw/canvas/compositor.ts", "draw/quads.ts",
  "map/motion.ts", "map/visibleObjects.ts", "draw/canvas/mask.ts", "draw/webgl/offscreenTarget.ts", "core/i18n.ts", "geo/geographic.ts",
  "map/picker.ts", "draw/webgl/shader.ts", "map/layerPlan.ts", "core/gl.ts", "tiles/url.ts", "map/viewport.ts", "draw/canvas/tilePictures.ts",
  "map/neighbourViews.ts", "map/cameras.ts", "core/dataTile.ts", "draw/depthMapping.ts", "geo/position.ts", "ui/attribution.ts", "core/retry.ts",
  "draw/canvas/shadingOptions.ts", "geo/shadows.ts", "map/mapItems.ts", "core/png.ts", "map/limits.ts", "overlay/marker.ts", "map/map.ts",
  "core/dom.ts", "tiles/source.ts", "core/events.ts", "draw/drawer.ts", "core/check.ts", "overlay/popup.ts", "draw/canvas/tileMosaic.ts",
  "map/options.ts", "draw/color.ts", "core/vec.ts", "geo/axes.ts", "core/errors.ts", "overlay/positionedLayer.ts", "core/position.ts",
  "core/inflate.ts", "draw/webgl/idTable.ts", "tiles/cover.ts", "draw/webgl/idTextures.ts", "ui/styles.ts",
];

/** Modules of the core in an order, found by trial, that puts similar code side by side: the bundle is 0.7 KB smaller gzipped. Modules that are not listed follow. */
export const MODULE_ORDER = [
  "ui/controls.ts", "map/visibleObjects.ts", "core/lengths.ts", "geo/daylight.ts", "ui/scaleBar.ts", "geo/shadows.ts", "map/cameraController.ts",
  "tiles/url.ts", "map/cameras.ts", "tiles/objects.ts", "core/inflate.ts", "map/findPosition.ts", "map/mapLight.ts", "core/i18n.ts", "core/retry.ts",
  "tiles/source.ts", "core/check.ts", "geo/camera.ts", "map/objectStyle.ts", "map/imageLayer.ts", "map/options.ts", "draw/depthMapping.ts",
  "map/relief.ts", "core/errors.ts", "draw/drawStyle.ts", "map/picker.ts", "draw/color.ts", "geo/geographic.ts", "tiles/decoder.ts",
  "draw/webgl/idTable.ts", "draw/webgl/shader.ts", "draw/webgl/webglDrawer.ts", "geo/frame.ts", "draw/canvas/mask.ts", "map/frameRenderer.ts",
  "map/frameLoop.ts", "geo/occupancy.ts", "draw/canvas/shadingOptions.ts", "map/pointerEvents.ts", "overlay/positionedLayer.ts", "tiles/tileData.ts",
  "map/gestures.ts", "draw/webgl/program.ts", "map/viewport.ts", "draw/quads.ts", "core/dataTile.ts", "ui/attribution.ts", "tiles/layerTiles.ts",
  "tiles/fetch.ts", "tiles/queue.ts", "draw/drawer.ts", "tiles/cover.ts", "map/limits.ts", "core/events.ts", "core/position.ts",
  "draw/webgl/offscreenTarget.ts", "map/layerPlan.ts", "core/network.ts", "draw/canvas/tilePictures.ts", "map/neighbourViews.ts", "tiles/cache.ts",
  "core/dom.ts", "map/keyboard.ts", "map/compatibility.ts", "draw/canvas/compositor.ts", "core/mapLayer.ts", "map/depthGroups.ts", "core/features.ts",
  "geo/position.ts", "ui/styles.ts", "tiles/pmtiles.ts", "core/gl.ts", "draw/canvas/canvasDrawer.ts", "draw/webgl/textures.ts", "overlay/popup.ts",
  "map/motion.ts", "geo/manifest.ts", "map/mapItems.ts", "overlay/marker.ts", "geo/light.ts", "core/shaders.ts", "core/vec.ts", "map/map.ts",
  "draw/webgl/idTextures.ts", "core/png.ts", "draw/canvas/tileMosaic.ts", "geo/axes.ts",
];

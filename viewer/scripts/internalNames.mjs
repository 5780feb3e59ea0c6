/**
 * Properties and methods that only the bundles themselves use: all bundles of a build give them the same short names. A name here is no part of the public API, of a
 * file format, of the DOM or of three.js, and no code makes it from a text or lists it as a key; test/unit/internalNames.test.ts checks what a test can check.
 */
export const INTERNAL_NAMES = `
  advanceCamera attachTo backoff_ms checkCompatible clearFailures clearPatches continueTurn copyToCanvas createContainer createName createTarget
  detachFrom distance_m drawerElement dropTiles ended_ms enterFullScreen estimateLight exitFullScreen fetchRelief findCenterSurface findFolders
  findView fitCanvas formatSample freeAllBut fullScreen getBakedLight getOrCreate hasFailed inTransition initializeView isCombinable isCovered
  isLoaded isLoading isReady isStale lightLayers limit_bytes listViewsAhead lonLatBox makePass makeRequest mediaType nextCamera nextView northFirst
  notGeoreferenced onManifest otherLabel placeElement releaseData replaceCanvas requestTransitionFrame requireGpu requiredKinds resetView restyle
  retryAfter_ms retry_ms rgbOrder rotateLeft rotateRight savePage screenCenter setCamera setCourse setFocus setLightEstimator setLimit setOffset
  setRequests setTransition showElement showsAt startGesture startInertia startTick start_ms straightDown syncCamera tileResources toggleCustomLayer
  transitionCamera turned_deg uncovered updateHeight usesCompositing
`.trim().split(/\s+/);

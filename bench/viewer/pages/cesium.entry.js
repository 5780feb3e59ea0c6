// What the page needs of CesiumJS, so that a bundler can leave out the rest.
export { Camera, Cartesian3, Cesium3DTileset, CesiumWidget, Color, DirectionalLight, OrthographicFrustum, Matrix4, Transforms } from "@cesium/engine";

// Exports the classes that the page uses, so the build drops the others.
export { Camera, Cartesian3, Cesium3DTileset, CesiumWidget, Color, DirectionalLight, OrthographicFrustum, Matrix4, Transforms } from "@cesium/engine";

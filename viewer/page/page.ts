import { map, imageLayer } from "./map3d.mjs";
const m = new map("mapcanvas");
new imageLayer(new URLSearchParams(location.search).get("rendering") ?? ".").addTo(m);

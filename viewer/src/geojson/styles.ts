import { css } from "../core/css";

/** Styles of features; colours come from the map. */
export const STYLES = css`
  .map3d-geojson {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    z-index: -1;
  }
  .map3d-overlay:has(> .map3d-geojson) {
    isolation: isolate;
  }
  .map3d.map3d-over > canvas {
    cursor: pointer;
  }
  .map3d-features {
    position: absolute;
    inset: 0;
    margin: 0;
    padding: 0;
    list-style: none;
  }
  .map3d-features button {
    position: absolute;
    left: 0;
    top: 0;
    min-height: 44px;
    max-width: 240px;
    padding: 4px 14px;
    border: 0;
    border-radius: 22px;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
  }
  .map3d-features button:not(:focus-visible) {
    opacity: 0;
  }
`;

import { css } from "../core/css";

/** Styles of these controls; colours come from the map. */
export const STYLES = css`
  .map3d-group :is([aria-pressed="true"], [aria-expanded="true"]) {
    color: var(--map3d-accent);
  }
  .map3d-group [aria-busy="true"] svg {
    animation: map3d-pulse 1s ease-in-out infinite alternate;
  }
  @keyframes map3d-pulse {
    to {
      opacity: 0.25;
    }
  }
  @media (prefers-reduced-motion: reduce) {
    .map3d-group [aria-busy="true"] svg {
      animation: none;
      opacity: 0.5;
    }
  }
  .map3d-accuracy {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    overflow: visible;
    fill: var(--map3d-accent);
    fill-opacity: 0.14;
    stroke: var(--map3d-accent);
    stroke-width: 1.5;
  }
  .map3d-overview-map {
    top: 0;
    width: 190px;
    height: 132px;
    overflow: hidden;
  }
  .map3d-overview-map[hidden] {
    display: none;
  }
  .map3d-overview-map .map3d {
    position: absolute;
    inset: 0;
  }
  .map3d-overview-pad {
    position: absolute;
    inset: 0;
    touch-action: none;
    cursor: pointer;
    overflow: hidden;
    border-radius: 12px;
  }
  .map3d-overview-pad:focus-visible {
    outline: 3px solid var(--map3d-accent);
    outline-offset: -3px;
  }
  .map3d-overview-frame {
    position: absolute;
    left: 0;
    top: 0;
    box-sizing: border-box;
    min-width: 8px;
    min-height: 8px;
    border: 2px solid var(--map3d-accent);
    box-shadow:
      0 0 0 1px rgb(255 255 255 / 0.8),
      0 0 0 999px rgb(0 0 0 / 0.16);
    cursor: grab;
  }
  @media (forced-colors: active) {
    .map3d-overview-map {
      border: 1px solid CanvasText;
    }
    .map3d-group :is([aria-pressed="true"], [aria-expanded="true"]) {
      forced-color-adjust: none;
      background: Highlight;
      color: HighlightText;
    }
    .map3d-overview-frame,
    .map3d-accuracy {
      forced-color-adjust: none;
    }
  }
  .map3d-corner {
    position: absolute;
    display: grid;
    gap: 10px;
    pointer-events: none;
  }
  .map3d .map3d-corner > * {
    position: relative;
    inset: auto;
    pointer-events: auto;
  }
  .map3d .map3d-corner > .map3d-buttons {
    display: grid;
    height: auto;
  }
  .map3d-topleft,
  .map3d-topright {
    top: max(12px, env(safe-area-inset-top));
  }
  .map3d-bottomleft,
  .map3d-bottomright {
    bottom: calc(34px + env(safe-area-inset-bottom));
  }
  .map3d-topleft,
  .map3d-bottomleft {
    left: max(12px, env(safe-area-inset-left));
    justify-items: start;
  }
  .map3d-topright,
  .map3d-bottomright {
    right: max(12px, env(safe-area-inset-right));
    justify-items: end;
  }
  .map3d .map3d-topleft .map3d-panel-button > :not(.map3d-group),
  .map3d .map3d-bottomleft .map3d-panel-button > :not(.map3d-group) {
    right: auto;
    left: calc(100% + 10px);
  }
  .map3d .map3d-topleft .map3d-panel-button > :not(.map3d-group),
  .map3d .map3d-topright .map3d-panel-button > :not(.map3d-group) {
    top: 0;
    bottom: auto;
  }
`;

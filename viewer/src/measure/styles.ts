import { css } from "../core/css";

/** Styles of measurements; colours come from the map. */
export const STYLES = css`
  .map3d-measure {
    position: absolute;
    inset: 0;
  }
  .map3d-measure svg {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    overflow: visible;
  }
  .map3d-measure path {
    fill: none;
    stroke-linejoin: round;
    stroke-linecap: round;
  }
  .map3d-measure-halo {
    stroke: rgb(255 255 255 / 0.85);
    stroke-width: 6;
  }
  .map3d-measure-line {
    stroke: var(--map3d-accent);
    stroke-width: 2.5;
  }
  .map3d-measure path.map3d-measure-filled {
    fill: var(--map3d-accent);
    fill-opacity: 0.2;
  }
  .map3d-measure circle {
    fill: #fff;
    stroke: var(--map3d-accent);
    stroke-width: 2.5;
  }
  .map3d-measure span {
    position: absolute;
    left: 0;
    top: 0;
    padding: 1px 7px;
    border-radius: 999px;
    white-space: pre;
    font-size: 12px;
    font-variant-numeric: tabular-nums;
    background: var(--map3d-panel);
    color: var(--map3d-faint);
    box-shadow: var(--map3d-shadow);
  }
  .map3d-measure span.map3d-measure-main {
    padding: 4px 11px;
    font-size: 14px;
    font-weight: 600;
    color: var(--map3d-ink);
    z-index: 1;
  }
  .map3d-measure span[hidden] {
    display: none;
  }
  .map3d-profile {
    position: absolute;
    left: 50%;
    bottom: max(12px, env(safe-area-inset-bottom));
    transform: translateX(-50%);
    width: min(440px, 100% - 24px);
    box-sizing: border-box;
    padding: 10px 12px 8px;
    border-radius: 14px;
    background: var(--map3d-panel);
    color: var(--map3d-ink);
    box-shadow: var(--map3d-shadow);
    pointer-events: auto;
    touch-action: none;
    cursor: crosshair;
    z-index: 2;
  }
  .map3d-profile:focus-visible {
    outline: 2px solid var(--map3d-accent);
    outline-offset: 2px;
  }
  .map3d-profile-field {
    position: relative;
    height: 96px;
    margin-top: 4px;
  }
  .map3d-profile-plot {
    position: absolute;
    inset: 0 50px 0 0;
  }
  .map3d-profile svg {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    overflow: visible;
  }
  .map3d-profile path {
    fill: none;
    vector-effect: non-scaling-stroke;
  }
  .map3d-profile-line {
    stroke: var(--map3d-accent);
    stroke-width: 2;
    stroke-linejoin: round;
  }
  .map3d-profile path.map3d-profile-fill {
    fill: var(--map3d-accent);
    fill-opacity: 0.16;
  }
  .map3d-profile-grid {
    stroke: var(--map3d-faint);
    stroke-opacity: 0.3;
    stroke-width: 1;
    stroke-dasharray: 2 3;
  }
  .map3d-profile-heights span {
    position: absolute;
    right: 0;
    transform: translateY(-50%);
    font-size: 11px;
    font-variant-numeric: tabular-nums;
    color: var(--map3d-faint);
    pointer-events: none;
  }
  .map3d-profile-cursor {
    position: absolute;
    top: 0;
    bottom: 0;
    width: 0;
    border-left: 1.5px solid var(--map3d-ink);
    pointer-events: none;
  }
  .map3d-profile-readout {
    margin-top: 4px;
    font-size: 13px;
    font-weight: 600;
    white-space: pre-wrap;
    font-variant-numeric: tabular-nums;
  }
  @media (forced-colors: active) {
    .map3d-measure path,
    .map3d-measure circle {
      forced-color-adjust: none;
    }
    .map3d-measure span {
      border: 1px solid CanvasText;
    }
  }
`;

import { css } from "../core/css";

/** Styles of legends; colours come from the map. */
export const STYLES = css`
  .map3d-legend {
    min-width: 0;
    margin: 0;
    padding: 0;
    border: 0;
    font-size: 13px;
  }
  .map3d-overlay > .map3d-legend {
    position: absolute;
    left: max(12px, env(safe-area-inset-left));
    bottom: calc(34px + env(safe-area-inset-bottom));
    width: max-content;
    max-width: min(300px, calc(100% - 90px));
    padding: 8px 12px 6px;
    border-radius: 12px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    pointer-events: auto;
  }
  .map3d-legend legend {
    float: left;
    width: 100%;
    padding: 0;
    font-weight: 600;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .map3d-legend ul {
    clear: both;
    list-style: none;
    margin: 0;
    padding: 0;
    max-height: 30vh;
    overflow-y: auto;
  }
  .map3d-legend button {
    display: flex;
    align-items: center;
    gap: 9px;
    width: 100%;
    min-height: 44px;
    padding: 0 4px;
    border: 0;
    border-radius: 8px;
    background: none;
    color: inherit;
    font: inherit;
    text-align: left;
    cursor: pointer;
  }
  .map3d-legend button > span {
    min-width: 0;
    overflow-wrap: anywhere;
    font-variant-numeric: tabular-nums;
  }
  .map3d-legend i {
    flex: none;
    width: 18px;
    height: 18px;
    border-radius: 5px;
    box-shadow: inset 0 0 0 1px rgb(0 0 0 / 0.16);
  }
  .map3d-legend button:focus-visible {
    outline: 3px solid var(--map3d-accent, currentColor);
    outline-offset: -3px;
  }
  .map3d-legend-filtered button[aria-pressed="false"] {
    opacity: 0.42;
  }
  .map3d-legend-ordered ul {
    display: flex;
    margin: 2px 0 0;
  }
  .map3d-legend-ordered li {
    flex: 1 1 0;
    min-width: 44px;
  }
  .map3d-legend-ordered button {
    flex-direction: column;
    align-items: stretch;
    justify-content: center;
    gap: 5px;
    padding: 0;
    border-radius: 0;
  }
  .map3d-legend-ordered button > span {
    text-align: center;
    font-size: 11.5px;
    overflow-wrap: normal;
    white-space: nowrap;
  }
  .map3d-legend-ordered i {
    width: auto;
    height: 12px;
    border-radius: 0;
  }
  .map3d-legend-ordered li:first-child i {
    border-radius: 6px 0 0 6px;
  }
  .map3d-legend-ordered li:last-child i {
    border-radius: 0 6px 6px 0;
  }
  .map3d-legend i {
    forced-color-adjust: none;
  }
  @media (prefers-contrast: more), (forced-colors: active) {
    .map3d-legend-filtered button[aria-pressed] {
      opacity: 1;
    }
    .map3d-legend button[aria-pressed="true"] {
      outline: 2px solid;
      outline-offset: -2px;
    }
    .map3d-legend i {
      box-shadow: inset 0 0 0 1px CanvasText;
    }
  }
`;

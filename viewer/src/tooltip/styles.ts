import { css } from "../core/css";

/** Styles of tooltips; colours come from the map. */
export const STYLES = css`
  .map3d-tooltip {
    position: absolute;
    left: 14px;
    top: 14px;
    padding: 3px 10px;
    border-radius: 8px;
    max-width: 260px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    font-size: 13px;
  }
`;

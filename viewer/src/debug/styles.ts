import { css } from "../core/css";

/** Styles of the outlines; colours come from the map. */
export const STYLES = css`
  .map3d-debug {
    position: absolute;
    inset: 0;
    font:
      11px/1.2 ui-monospace,
      monospace;
  }
  .map3d-debug > div {
    position: absolute;
    box-sizing: border-box;
    padding: 3px;
    border: 1px solid rgb(200 30 90 / 0.7);
    color: rgb(170 10 70);
    overflow: hidden;
    white-space: pre;
  }
  .map3d-debug > p {
    position: absolute;
    top: 4px;
    left: 4px;
    margin: 0;
    padding: 2px 6px;
    background: var(--map3d-panel);
  }
`;

import { css } from "../core/css";

/** Styles of clusters; colours come from the map. */
export const STYLES = css`
  .map3d-cluster {
    display: grid;
    place-content: center;
    min-width: 38px;
    height: 38px;
    padding: 0 7px;
    box-sizing: border-box;
    border: 3px solid #fff;
    border-radius: 19px;
    font-weight: 650;
    font-size: 13px;
    font-variant-numeric: tabular-nums;
    background: var(--map3d-marker, var(--map3d-accent));
    color: #fff;
    box-shadow:
      0 0 0 1px rgb(0 0 0 / 0.2),
      0 2px 8px rgb(0 0 0 / 0.35);
  }
  .map3d-legs {
    position: absolute;
    inset: 0;
    width: 100%;
    height: 100%;
    overflow: visible;
  }
  .map3d-legs line {
    stroke: var(--map3d-ink);
    stroke-width: 1.5;
    opacity: 0.6;
  }
  @media (prefers-color-scheme: dark) {
    .map3d-cluster {
      color: #10222a;
      border-color: #26292d;
    }
  }
`;

import { css } from "../core/css";

/** Styles of the drop hint; colours come from the map. */
export const STYLES = css`
  .map3d-drop {
    position: absolute;
    inset: 0;
    z-index: 6;
    display: grid;
    place-content: center;
    padding: 40px;
    text-align: center;
    text-wrap: balance;
    font-size: 17px;
    font-weight: 550;
    pointer-events: none;
    visibility: hidden;
    opacity: 0;
    transition: opacity 0.12s;
  }
  .map3d-drop::before {
    content: "";
    position: absolute;
    inset: 12px;
    z-index: -1;
    border: 2px dashed var(--map3d-accent);
    border-radius: 16px;
    background: var(--map3d-panel);
  }
  .map3d-drop[data-over] {
    visibility: visible;
    opacity: 1;
  }
  @media (prefers-reduced-motion: reduce) {
    .map3d-drop {
      transition: none;
    }
  }
`;

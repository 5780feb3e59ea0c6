import { css } from "../core/css";

/** Styles of the swipe divider, the epochs slider and the names of directions; colours come from the map. */
export const STYLES = css`
  .map3d-facing {
    position: absolute;
    top: 12px;
    left: 0;
    right: 0;
    width: fit-content;
    max-width: calc(100% - 8px);
    margin: auto;
    box-sizing: border-box;
    padding: 3px 10px;
    border-radius: 999px;
    font-size: 13px;
    font-weight: 550;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    text-align: center;
  }
  .map3d-swipe {
    position: absolute;
    top: 0;
    bottom: 0;
    width: 44px;
    margin-left: -22px;
    padding: 0;
    border: 0;
    background: none;
    cursor: ew-resize;
    pointer-events: auto;
    touch-action: none;
    outline: none;
  }
  .map3d-swipe::before {
    content: "";
    position: absolute;
    left: 20.5px;
    top: 0;
    bottom: 0;
    width: 3px;
    background: #fff;
    box-shadow:
      0 0 0 1px rgb(0 0 0 / 0.22),
      0 0 10px rgb(0 0 0 / 0.25);
  }
  .map3d-swipe::after {
    content: "";
    position: absolute;
    left: 0;
    top: calc(50% - 22px);
    width: 44px;
    height: 44px;
    border-radius: 50%;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
  }
  .map3d-swipe svg {
    position: absolute;
    left: 9px;
    top: calc(50% - 13px);
    width: 26px;
    height: 26px;
    z-index: 1;
  }
  .map3d-swipe:focus-visible::after {
    outline: 3px solid var(--map3d-accent);
  }
  .map3d-swipe-name {
    position: absolute;
    top: 12px;
    width: max-content;
    max-width: 28vw;
    box-sizing: border-box;
    padding: 3px 10px;
    border-radius: 999px;
    font-size: 13px;
    font-weight: 550;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
    z-index: 1;
  }
  .map3d-swipe-name:first-of-type {
    right: 34px;
  }
  .map3d-swipe-name:last-of-type {
    left: 34px;
  }
  .map3d-epochs {
    position: absolute;
    left: 50%;
    transform: translateX(-50%);
    bottom: calc(34px + env(safe-area-inset-bottom));
    width: min(420px, calc(100% - 150px));
    box-sizing: border-box;
    padding: 6px 16px 8px;
    border-radius: 12px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    pointer-events: auto;
  }
  .map3d-epochs output {
    display: block;
    text-align: center;
    font-weight: 600;
    font-variant-numeric: tabular-nums;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
  .map3d-epochs input {
    display: block;
    width: 100%;
    height: 44px;
    margin: -8px 0 -10px;
    outline: none;
    accent-color: var(--map3d-accent);
    cursor: pointer;
  }
  .map3d-epochs:has(:focus-visible) {
    outline: 3px solid var(--map3d-accent);
  }
  .map3d-epochs div {
    display: flex;
    justify-content: space-between;
    gap: 12px;
    font-size: 11.5px;
    color: var(--map3d-faint);
    font-variant-numeric: tabular-nums;
  }
  .map3d-epochs div span {
    min-width: 0;
    overflow: hidden;
    text-overflow: ellipsis;
    white-space: nowrap;
  }
`;

import { css } from "../core/css";

/** Styles of the labels: dark text with a light halo, which reads on roofs and streets by day and by night. */
export const STYLES = css`
  .map3d-labels {
    position: absolute;
    inset: 0;
    overflow: hidden;
    pointer-events: none;
  }
  .map3d-label {
    position: absolute;
    left: 0;
    top: 0;
    width: max-content;
    color: #16181b;
    font-size: 13px;
    font-weight: 600;
    line-height: 16px;
    white-space: nowrap;
    opacity: 0;
    transition: opacity 0.2s;
    text-shadow:
      0 0 3px #fff,
      1px 1px 1px #fff,
      -1px 1px 1px #fff,
      1px -1px 1px #fff,
      -1px -1px 1px #fff,
      0 2px 2px #fff,
      0 -2px 2px #fff,
      2px 0 2px #fff,
      -2px 0 2px #fff;
  }
  .map3d-label-shown {
    opacity: 1;
  }
  .map3d-label-line {
    font-style: italic;
    font-weight: 500;
  }
  @media (prefers-reduced-motion: reduce) {
    .map3d-label {
      transition: none;
    }
  }
  @media (forced-colors: active) {
    .map3d-label {
      forced-color-adjust: none;
      background: Canvas;
      color: CanvasText;
      text-shadow: none;
    }
  }
`;

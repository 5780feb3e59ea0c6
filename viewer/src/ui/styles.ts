import { css } from "../core/css";

/** The viewer's style sheet. Pages adapt it through the custom properties. */
export const STYLES = css`
  .map3d {
    --map3d-accent: #0e7490;
    --map3d-background: #f2f0eb;
    --map3d-panel: rgb(255 255 255 / 0.92);
    --map3d-ink: #26282b;
    --map3d-faint: #5d6166;
    --map3d-line: rgb(38 40 43 / 0.12);
    --map3d-shadow: 0 1px 2px rgb(38 40 43 / 0.1), 0 4px 16px rgb(38 40 43 / 0.1);
    display: block;
    overflow: hidden;
    background: var(--map3d-background);
    color: var(--map3d-ink);
    font:
      400 14px/1.4 system-ui,
      sans-serif;
    -webkit-tap-highlight-color: transparent;
    outline: none;
  }
  @media (prefers-color-scheme: dark) {
    .map3d {
      --map3d-accent: #56b6cc;
      --map3d-background: #1b1d20;
      --map3d-panel: rgb(38 41 45 / 0.92);
      --map3d-ink: #eceae5;
      --map3d-faint: #a5a8ab;
      --map3d-line: rgb(255 255 255 / 0.14);
      --map3d-shadow: 0 1px 2px rgb(0 0 0 / 0.4), 0 4px 16px rgb(0 0 0 / 0.35);
    }
  }
  @media (prefers-contrast: more) {
    .map3d {
      --map3d-accent: #004f63;
      --map3d-background: #fff;
      --map3d-panel: #fff;
      --map3d-ink: #000;
      --map3d-faint: #1c1e20;
      --map3d-line: #000;
      --map3d-shadow: 0 0 0 2px #000;
    }
  }
  @media (prefers-contrast: more) and (prefers-color-scheme: dark) {
    .map3d {
      --map3d-accent: #8fe3f7;
      --map3d-background: #000;
      --map3d-panel: #000;
      --map3d-ink: #fff;
      --map3d-faint: #e8e8e8;
      --map3d-line: #fff;
      --map3d-shadow: 0 0 0 2px #fff;
    }
  }
  @media (forced-colors: active) {
    .map3d {
      --map3d-accent: Highlight;
      --map3d-background: Canvas;
      --map3d-panel: Canvas;
      --map3d-ink: CanvasText;
      --map3d-faint: CanvasText;
      --map3d-line: CanvasText;
    }
  }
  .map3d > canvas {
    touch-action: none;
    cursor: grab;
    user-select: none;
    -webkit-user-select: none;
  }
  .map3d-cooperative > canvas {
    touch-action: pan-x pan-y;
  }
  .map3d-hint {
    position: absolute;
    inset: 0;
    display: grid;
    place-items: center;
    margin: 0;
    padding: 1em;
    background: rgb(0 0 0 / 55%);
    color: #fff;
    font-size: 1.25em;
    text-align: center;
    pointer-events: none;
  }
  .map3d-dragging > canvas {
    cursor: grabbing;
  }
  .map3d-box {
    position: absolute;
    box-sizing: border-box;
    border: 2px solid var(--map3d-accent);
    background: var(--map3d-line);
    pointer-events: none;
  }
  .map3d:focus-visible::after {
    content: "";
    position: absolute;
    inset: 0;
    border: 3px solid var(--map3d-accent);
    pointer-events: none;
    z-index: 5;
  }
  .map3d-overlay,
  .map3d-controls {
    position: absolute;
    inset: 0;
    pointer-events: none;
    overflow: hidden;
  }
  .map3d-controls > * {
    pointer-events: auto;
  }
  .map3d button {
    font: inherit;
    color: inherit;
    cursor: pointer;
  }
  .map3d button:focus-visible {
    outline: 3px solid var(--map3d-accent);
    outline-offset: 1px;
  }
  .map3d-icon {
    display: block;
    width: 20px;
    height: 20px;
    margin: auto;
    fill: none;
    stroke: currentColor;
    stroke-width: 1.8;
    stroke-linecap: round;
    stroke-linejoin: round;
  }

  .map3d-buttons {
    position: absolute;
    right: max(12px, env(safe-area-inset-right));
    bottom: calc(34px + env(safe-area-inset-bottom));
    display: grid;
    gap: 10px;
    pointer-events: none;
  }
  .map3d-buttons > * {
    pointer-events: auto;
  }
  @media (max-height: 660px) {
    .map3d-buttons {
      display: flex;
      flex-flow: column wrap-reverse;
      justify-content: flex-end;
      height: min(280px, calc(100% - 46px));
    }
  }
  .map3d-group {
    display: grid;
    border-radius: 12px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    overflow: hidden;
  }
  .map3d-group button {
    width: 44px;
    height: 44px;
    padding: 0;
    border: 0;
    background: none;
  }
  .map3d-group button + button {
    border-top: 1px solid var(--map3d-line);
  }
  .map3d-group button:hover {
    background: var(--map3d-line);
  }
  .map3d-group button:focus-visible {
    outline-offset: -3px;
    border-radius: 12px;
  }
  .map3d-group button:disabled {
    opacity: 0.35;
    cursor: default;
    background: none;
  }
  .map3d-compass svg {
    width: 30px;
    height: 30px;
    transition: transform 0.3s;
  }
  .map3d-compass .map3d-north {
    fill: var(--map3d-accent);
    stroke: none;
  }
  .map3d-compass .map3d-south {
    fill: var(--map3d-faint);
    stroke: none;
    opacity: 0.55;
  }
  @media (prefers-reduced-motion: reduce) {
    .map3d-compass svg {
      transition: none;
    }
  }

  .map3d-scale {
    position: absolute;
    left: max(16px, env(safe-area-inset-left));
    bottom: calc(8px + env(safe-area-inset-bottom));
    height: 14px;
    box-sizing: border-box;
    border: solid var(--map3d-faint);
    border-width: 0 1.5px 1.5px;
    background: var(--map3d-panel);
    color: var(--map3d-faint);
    font-size: 11px;
    line-height: 12px;
    text-align: center;
    pointer-events: none;
  }
  .map3d-scale[hidden] {
    display: none;
  }

  .map3d-attribution {
    position: absolute;
    right: 0;
    bottom: 0;
    max-width: 100%;
    box-sizing: border-box;
    margin: 0;
    padding: 3px 12px calc(4px + env(safe-area-inset-bottom));
    border-radius: 8px 0 0;
    background: var(--map3d-panel);
    color: var(--map3d-faint);
    font-size: 11px;
    text-align: right;
    pointer-events: none;
  }
  .map3d-attribution:empty {
    display: none;
  }
  .map3d-message {
    position: absolute;
    inset: 0;
    display: grid;
    place-content: center;
    margin: 0;
    padding: 24px;
    text-align: center;
    max-width: 42ch;
    justify-self: center;
    margin-inline: auto;
  }

  .map3d-marker {
    position: absolute;
    left: 0;
    top: 0;
    width: 44px;
    height: 44px;
    margin: -22px 0 0 -22px;
    padding: 0;
    border: 0;
    background: none;
    pointer-events: auto;
  }
  .map3d-marker[hidden],
  .map3d-popup[hidden] {
    display: none;
  }
  .map3d-marker::before {
    content: "";
    position: absolute;
    left: 16px;
    top: 16px;
    width: 8px;
    height: 8px;
    border: 2px solid #fff;
    border-radius: 50%;
    background: var(--map3d-marker, var(--map3d-accent));
    box-shadow:
      0 0 0 1px rgb(0 0 0 / 0.25),
      0 1px 4px rgb(0 0 0 / 0.4);
  }
  .map3d-marker-stem {
    position: absolute;
    left: 21px;
    bottom: 28px;
    width: 2px;
    height: 18px;
    background: var(--map3d-marker, var(--map3d-accent));
  }
  .map3d-marker-label {
    position: absolute;
    left: 22px;
    bottom: 44px;
    transform: translateX(-50%);
    padding: 3px 10px;
    border-radius: 999px;
    white-space: nowrap;
    font-size: 13px;
    font-weight: 550;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    max-width: 220px;
    overflow: hidden;
    text-overflow: ellipsis;
  }
  .map3d-marker-selected {
    z-index: 2;
  }
  .map3d-marker-selected .map3d-marker-label {
    background: var(--map3d-marker, var(--map3d-accent));
    color: #fff;
  }
  .map3d-marker:has(> .map3d-marker-icon)::before {
    display: none;
  }
  .map3d-marker-icon {
    position: absolute;
    left: 50%;
    top: 50%;
    transform: translate(-50%, -50%);
  }
  .map3d-marker-occluded {
    opacity: 0.38;
  }
  .map3d-marker-draggable {
    touch-action: none;
    cursor: grab !important;
  }
  .map3d-marker-hover-label:not(:hover, :focus-visible, .map3d-marker-selected) > :not(.map3d-marker-icon) {
    display: none;
  }

  .map3d-popup {
    position: absolute;
    left: 0;
    top: 0;
    z-index: 3;
    min-width: 60px;
    max-width: min(300px, 80vw);
    padding: 10px 14px;
    border-radius: 12px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    pointer-events: auto;
  }
  .map3d-popup::after {
    content: "";
    position: absolute;
    left: 50%;
    bottom: -5px;
    width: 10px;
    height: 10px;
    margin-left: -5px;
    background: inherit;
    clip-path: polygon(0 50%, 100% 50%, 50% 100%);
  }
  .map3d-popup:has(.map3d-popup-close) {
    padding-right: 46px;
  }
  .map3d-popup-body {
    overflow-wrap: anywhere;
    max-height: 40vh;
    overflow-y: auto;
  }
  .map3d-popup-close {
    position: absolute;
    right: 0;
    top: -2px;
    width: 44px;
    height: 44px;
    padding: 0;
    border: 0;
    background: none;
    color: var(--map3d-faint) !important;
  }
  .map3d-popup-close svg {
    width: 16px;
    height: 16px;
  }

  @media (prefers-contrast: more), (forced-colors: active) {
    .map3d-scale,
    .map3d-attribution {
      background: var(--map3d-panel);
    }
    .map3d-group button:disabled {
      opacity: 0.55;
    }
    .map3d-compass .map3d-south {
      opacity: 1;
    }
    .map3d-marker-selected .map3d-marker-label {
      background: var(--map3d-ink);
      color: var(--map3d-panel);
    }
  }
  @media (forced-colors: active) {
    .map3d-group,
    .map3d-marker-label,
    .map3d-popup {
      border: 1px solid CanvasText;
    }
    .map3d-group button:disabled {
      opacity: 1;
      color: GrayText;
    }
    .map3d-compass path,
    .map3d-marker::before,
    .map3d-marker-stem {
      forced-color-adjust: none;
    }
    .map3d-compass .map3d-south {
      fill: none;
      stroke: CanvasText;
    }
    .map3d-marker-selected .map3d-marker-label {
      forced-color-adjust: none;
      background: Highlight;
      color: HighlightText;
    }
  }
`;

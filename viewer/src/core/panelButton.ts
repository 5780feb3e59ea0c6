import { css } from "./css";
import { adoptStyles, element } from "./dom";

const STYLES = css`
  .map3d-panel-button {
    position: relative;
  }
  .map3d-panel-button > :not(.map3d-group) {
    position: absolute;
    right: calc(100% + 10px);
    border-radius: 12px;
    background: var(--map3d-panel);
    box-shadow: var(--map3d-shadow);
    z-index: 4;
  }
  @media (max-height: 660px) {
    .map3d-panel-button > :not(.map3d-group) {
      right: calc(100% + 64px);
    }
  }
  .map3d-status {
    bottom: 0;
    width: max-content;
    max-width: min(260px, calc(100vw - 90px));
    margin: 0;
    padding: 10px 14px;
  }
  .map3d-status:empty {
    display: none;
  }
  @media (forced-colors: active) {
    .map3d-status {
      border: 1px solid CanvasText;
    }
  }
`;

/** Adds a button above a map's other buttons, with a panel that opens next to it. */
export function addPanelButton(
  { controlPane }: { readonly controlPane: HTMLElement },
  button: HTMLButtonElement,
  panel: HTMLElement,
): HTMLElement {
  adoptStyles(document, STYLES);
  const column = controlPane.querySelector(".map3d-buttons") ?? controlPane.appendChild(element("div", "map3d-buttons"));
  const box = element("div", "map3d-panel-button", {}, element("div", "map3d-group", {}, button), panel);
  column.prepend(box);
  return box;
}

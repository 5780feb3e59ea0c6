/** Of measurements; colours are the map's. */
export const STYLES = `
.map3d-measure { position: absolute; inset: 0; }
.map3d-measure svg { position: absolute; inset: 0; width: 100%; height: 100%; overflow: visible; }
.map3d-measure path { fill: none; stroke-linejoin: round; stroke-linecap: round; }
.map3d-measure-halo { stroke: rgb(255 255 255 / 0.85); stroke-width: 6; }
.map3d-measure-line { stroke: var(--map3d-accent); stroke-width: 2.5; }
.map3d-measure path.map3d-measure-filled { fill: var(--map3d-accent); fill-opacity: 0.2; }
.map3d-measure circle { fill: #fff; stroke: var(--map3d-accent); stroke-width: 2.5; }
.map3d-measure span { position: absolute; left: 0; top: 0; padding: 1px 7px; border-radius: 999px; white-space: pre; font-size: 12px; font-variant-numeric: tabular-nums; background: var(--map3d-panel); color: var(--map3d-faint); box-shadow: var(--map3d-shadow); }
.map3d-measure span.map3d-measure-main { padding: 4px 11px; font-size: 14px; font-weight: 600; color: var(--map3d-ink); z-index: 1; }
.map3d-measure span[hidden] { display: none; }
@media (forced-colors: active) { .map3d-measure path, .map3d-measure circle { forced-color-adjust: none; } .map3d-measure span { border: 1px solid CanvasText; } }
`;

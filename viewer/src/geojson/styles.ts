/** Of features and clusters; colours are the map's. */
export const STYLES = `
.map3d-geojson { position: absolute; inset: 0; width: 100%; height: 100%; z-index: -1; }
.map3d-overlay:has(> .map3d-geojson) { isolation: isolate; }
.map3d-over > canvas { cursor: pointer; }
.map3d-features { position: absolute; inset: 0; margin: 0; padding: 0; list-style: none; }
.map3d-features button { position: absolute; left: 0; top: 0; min-height: 44px; max-width: 240px; padding: 4px 14px; border: 0; border-radius: 22px; overflow: hidden; text-overflow: ellipsis; white-space: nowrap;
  background: var(--map3d-panel); box-shadow: var(--map3d-shadow); }
.map3d-features button:not(:focus-visible) { opacity: 0; }
.map3d-cluster { display: grid; place-content: center; min-width: 36px; height: 36px; padding: 0 6px; box-sizing: border-box; border: 3px solid #fff; border-radius: 18px; font-weight: 650; font-size: 13px; font-variant-numeric: tabular-nums;
  background: var(--map3d-marker, var(--map3d-accent)); color: #fff; box-shadow: 0 0 0 1px rgb(0 0 0 / 0.2), 0 2px 8px rgb(0 0 0 / 0.35); }
.map3d-legs { position: absolute; inset: 0; width: 100%; height: 100%; overflow: visible; }
.map3d-legs line { stroke: var(--map3d-ink); stroke-width: 1.5; opacity: 0.6; }
@media (prefers-color-scheme: dark) { .map3d-cluster { color: #10222a; } }
`;

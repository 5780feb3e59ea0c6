/** A corner of the map. */
export type Corner = "topleft" | "topright" | "bottomleft" | "bottomright";

/** @internal Adds a control to a corner of a map: the entry `controls`. */
export type AddToCorner = (controlPane: HTMLElement, control: HTMLElement, corner: Corner) => void;

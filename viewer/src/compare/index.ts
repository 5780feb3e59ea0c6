/** map3d-compare: two renderings side by side, and times one after another. */
export { swipe, type Layers, type SwipeEvents, type SwipeOptions } from "./swipe";
export { epochs, type Epoch, type EpochsEvents, type EpochsOptions } from "./epochs";

/** map3d-compare: compares renderings with a swipe divider or a time slider. */
export { swipe, type Layers, type SwipeEvents, type SwipeOptions } from "./swipe";
export { epochs, type Epoch, type EpochsEvents, type EpochsOptions } from "./epochs";
